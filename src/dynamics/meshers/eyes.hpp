/// \file
/// The plane figure behind rods, links and crank webs: two eyes joined by a shank, cut into mapped quadrilaterals.
#pragma once

#include <array>
#include <functional>
#include <string>
#include <vector>

#include "dynamics/meshers/block_builder.hpp"

namespace espalier::dynamics {

/// One eye: a ring between two circles; the hole can be filled by a disc.
struct Eye {
  double centre_x;
  double inner, outer;
  double half_angle;  ///< the shank meets the outer circle between -half_angle and +half_angle (from its axis)
  double direction;   ///< +1: the shank leaves towards +x, -1: towards -x
};

/// A mapped quadrilateral of the figure.
struct PlaneBlock {
  std::function<std::array<double, 2>(double u, double v)> map;  ///< same handedness as (x, y)
  int nu, nv;
};

/// Element counts of the figure.
struct EyeDivisions {
  int radial;  ///< across a ring
  int arc[4];  ///< along the four arcs of every circle: towards the shank, then anticlockwise
  int core;    ///< between the disc's core and its circle
};

/// Four blocks of the ring: u from the inner to the outer circle, v along the arc.
std::vector<PlaneBlock> ring_blocks(const Eye& eye, const EyeDivisions& n);
/// Five blocks of the disc that fills the hole: a core and four around it (u from the core to the circle).
std::vector<PlaneBlock> disc_blocks(const Eye& eye, const EyeDivisions& n);
/// The shank between the outer circles of two eyes.
PlaneBlock shank_block(const Eye& from, const Eye& to, int along, const EyeDivisions& n);
/// Lengths of the four arcs at radius 1, for choosing EyeDivisions::arc.
std::array<double, 4> arc_angles(const Eye& eye);

/// Extrudes a plane block along z.
void extrude(BlockBuilder& builder, const PlaneBlock& block, const Stretch& z, const std::string& set,
             const std::vector<NamedSide>& sides);

}  // namespace espalier::dynamics

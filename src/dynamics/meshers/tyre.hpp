/// \file
/// The carcass of a tyre with what closes it at the rim: a closed torus of hexahedra.
#pragma once

#include "dynamics/meshers/parts.hpp"

namespace espalier::dynamics {

/// A tyre about the y axis. Its section is a ring of one thickness, a circle in the middle, symmetric to y = 0; the
/// part of it that sits on the rim closes it, so that air inside has no resultant. Face sets: inside (where air
/// presses), outside (what may touch a road), rim (where it sits), and the rim in `sectors` equal sectors, from the x
/// axis towards z: rim_0, rim_1 and so on. Held sector by sector it stays round.
struct TyreShape {
  double radius = 0.40;          ///< of the tread, outside
  double section_radius = 0.10;  ///< of the middle of the carcass in a section
  double thickness = 0.010;      ///< below the section radius
  double opening = 0.7;          ///< half the angle of the section that sits on the rim, radians
  int sectors = 8;
};
/// @param around    elements along the circumference, a multiple of the sectors
/// @param across    along the arc of a section outside of the rim
/// @param thickness through the carcass, the third direction of the elements
/// @throws std::invalid_argument that says what is wrong with the shape
Mesh make_tyre(const TyreShape& shape, int around, int across, int thickness, ElementType type = ElementType::hex8);
Mesh make_tyre(const TyreShape& shape, const MeshSize& size);

}  // namespace espalier::dynamics

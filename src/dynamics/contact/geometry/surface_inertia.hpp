/// \file
/// The solid inside a closed surface: volume, centre, inertia.
#pragma once

#include <string>

#include "dynamics/contact/geometry/triangles.hpp"

namespace espalier::dynamics::contact {

struct SurfaceSolid {
  double volume = 0;
  Vec3 centre = Vec3::Zero();
  Mat3 inertia = Mat3::Zero();  ///< about the centre, of density 1: integral of (x . x) I - x x^T
  Vec3 extents = Vec3::Zero();  ///< of the surface along the axes
};

/// Sums over tetrahedra between the triangles and one point (the divergence theorem for polynomials): exact but for
/// rounding. @throws Error(invalid_input) beginning with `name` where the surface is open, with the place of the first
/// hole and how many edges it has, or where a piece of it looks inwards without being a cavity, or lies within another
[[nodiscard]] SurfaceSolid solid_inside(const TriangleSurface& surface, const std::string& name);

}  // namespace espalier::dynamics::contact

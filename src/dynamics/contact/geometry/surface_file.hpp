/// \file
/// Rigid surfaces from files: .stl (text or binary), .obj (v and f; polygons are cut into triangles), or the outer
/// faces of a mesh file that mesh/read.hpp knows.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "dynamics/contact/geometry/triangles.hpp"

namespace espalier::dynamics::contact {

/// Triangles as a file states them.
struct Triangles {
  std::vector<Vec3> points;
  std::vector<std::array<Index, 3>> triangles;
};

/// @param scale  factors on the coordinates; a mirror image keeps looking outwards @throws Error(invalid_input)
[[nodiscard]] Triangles read_triangles(const std::string& path, const Vec3& scale);
[[nodiscard]] TriangleSurface read_surface(const std::string& path, const Vec3& scale);

}  // namespace espalier::dynamics::contact

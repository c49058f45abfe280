/// \file
/// Shape functions of the faces of solids.
#pragma once

#include <array>
#include <map>
#include <span>

#include "dynamics/mesh/mesh.hpp"

namespace espalier::dynamics {

/// Shape functions of a face and their derivatives at (r, s): of triangles from 0 to 1, of quadrilaterals from -1 to 1.
struct FaceFunctions {
  std::array<double, 8> n{}, r{}, s{};
};
[[nodiscard]] FaceFunctions face_functions(ElementType type, double r, double s);

/// The integral of each node's shape function over faces, by node. At corners of faces of second order it may be 0 or
/// negative.
[[nodiscard]] std::map<Index, double> area_weights(const Mesh& mesh, std::span<const MeshFace> faces);

}  // namespace espalier::dynamics

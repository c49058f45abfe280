/// \file
/// Faces of solids whose elements fail: which are seen when.
#pragma once

#include <vector>

#include "dynamics/model/mechanism.hpp"
#include "dynamics/page/drawn.hpp"

namespace espalier::dynamics::page {

/// A face of an element, and the element on its other side; -1: none.
struct TwoSidedFace {
  MeshFace face;
  Index behind = -1;
};
/// The faces of all solids of a mesh, inner ones from both sides.
[[nodiscard]] std::vector<TwoSidedFace> all_faces(const Mesh& mesh);

/// From when until when each triangle is seen, two numbers each: from the time at which the element behind it has
/// failed (minus infinity: none is there) to that of its own element (infinity: never). Empty where no element can
/// fail.
[[nodiscard]] std::vector<double> times_of_triangles(const model::Mechanism& mechanism, const Drawn& drawn);

}  // namespace espalier::dynamics::page

/// \file
/// Rigid shapes as faces, for pictures.
#pragma once

#include "dynamics/contact/geometry/shape.hpp"

namespace espalier::dynamics::contact {

/// Points in the axes of the shape; faces of three or four of them, anticlockwise seen from outside.
struct Outline {
  std::vector<Vec3> points;
  std::vector<std::vector<Index>> faces;
};
/// Round shapes get faces of 15 to 22 degrees. Planes have none.
[[nodiscard]] Outline outline_of(const Shape& shape);

}  // namespace espalier::dynamics::contact

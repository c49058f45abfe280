/// \file
/// The elements in which a point of the material lies.
#pragma once

#include "dynamics/model/fields/sampled_body.hpp"

namespace espalier::dynamics::model {

/// Natural coordinates in an element; of lines also how far the point is from the axis, along the section's y and z.
struct Located {
  Index element = 0;
  std::array<double, 3> xi{};
  double y = 0, z = 0;
};

/// All elements that a point is in, on sides that they share too. @param point  in the coordinates of the mesh, of the
/// body without strain @throws std::invalid_argument where there is none
[[nodiscard]] std::vector<Located> locate(const SampledBody& body, const Vec3& point);

}  // namespace espalier::dynamics::model

/// \file
/// From the points where elements are sampled to any other point of an element.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "dynamics/elements/element.hpp"
#include "dynamics/elements/shape_functions.hpp"

namespace espalier::dynamics::model {

/// One for each sample point of an element; those that it has not are 0.
using SampleWeights = std::array<double, 8>;

/// Natural coordinates of the points, with the weights of their rule.
[[nodiscard]] std::span<const QuadraturePoint> points_of(SamplePoints where);
/// Weights that give the value at xi: constant, linear, trilinear, and quadratic along a line.
[[nodiscard]] SampleWeights weights_at(SamplePoints where, const double* xi);
/// Natural coordinates of the middle of a solid.
[[nodiscard]] std::array<double, 3> middle_of(ElementType type);
/// Natural coordinates of the nodes of solids that are simulated, and of line2.
[[nodiscard]] std::vector<std::array<double, 3>> node_coordinates(ElementType type);
/// det(dX/dxi) of a solid. @param reference 3 numbers per node
[[nodiscard]] double volume_ratio(ElementType type, const double* xi, const double* reference);

}  // namespace espalier::dynamics::model

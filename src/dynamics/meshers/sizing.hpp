/// \file
/// From a wished number of unknowns to an element size.
#pragma once

#include <algorithm>
#include <cmath>

#include "dynamics/meshers/parts.hpp"

namespace espalier::dynamics {

/// Elements along a length, at least `smallest`.
inline int divisions(double length, double element_size, int smallest = 1) {
  constexpr double kMost = 1e9;  // BlockBuilder refuses so many
  const double number = std::round(length / element_size);
  return number > smallest ? static_cast<int>(std::min(number, kMost)) : smallest;  // NaN: smallest
}

/// Calls build(element_size) with sizes corrected by the cube root of the ratio of unknowns until the wish is met
/// within 15 %, at most six times; returns the nearest mesh (parts have a smallest mesh below which nothing changes).
/// @param first a size to start from
template <class Build>
Mesh mesh_to_size(const MeshSize& size, double first, const Build& build) {
  double h = first, best_error = 1e300;
  Mesh best;
  // Start coarse: a fine first guess would cost the time of a large mesh.
  for (int trial = 0; trial < 6; ++trial) {
    Mesh mesh = build(h);
    const double ratio = 3.0 * static_cast<double>(mesh.nodes.size()) / size.unknowns;
    const double error = std::abs(std::log(ratio));
    if (error < best_error) {
      best_error = error;
      best = std::move(mesh);
    }
    if (error < 0.14) break;
    h *= std::cbrt(ratio);
  }
  return best;
}

}  // namespace espalier::dynamics

#pragma once

#include <array>

namespace espalier::dynamics {

/// Andrews' mechanism at t = 0.03 in extended precision, by a second implementation that shares nothing with
/// andrews.cpp or with the integrators: the index-1 form [M G^T; G 0] [a; lambda] = [f; gamma] as an ordinary
/// differential equation in (q, v), by extrapolation of the midpoint rule in long double. G and gamma come from
/// truncated Taylor series of the constraints along lines. Order: q (7), v (7), a (7), lambda (6).
struct AndrewsTruth {
  std::array<long double, 27> y{};
  long double position = 0;  ///< largest constraint at the end: what the integration has drifted
  long double velocity = 0;  ///< largest rate of a constraint at the end
};
/// `steps` extrapolation steps over the interval; 1500 steps drift by 1e-16 in position.
[[nodiscard]] AndrewsTruth andrews_truth(int steps);

}  // namespace espalier::dynamics

/// \file
/// The elastic force of a contact by penalty.
#pragma once

namespace espalier::dynamics {

/// Force of a penetration p, its first two derivatives by p, and the energy stored.
struct PenaltyForce {
  double force = 0, slope = 0, bend = 0, energy = 0;
};

/// 0 for p <= 0, k p^2 / (2 e) for p < e, k (p - e/2) beyond: the slope builds up over `e`, so that it is continuous.
[[nodiscard]] inline PenaltyForce penalty(double p, double k, double e) {
  if (p <= 0) return {};
  if (p < e) return {0.5 * k * p * p / e, k * p / e, k / e, k * p * p * p / (6 * e)};
  return {k * (p - 0.5 * e), k, 0, k * (0.5 * p * p - 0.5 * e * p + e * e / 6)};
}

}  // namespace espalier::dynamics

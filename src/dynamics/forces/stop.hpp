/// \file
/// Stops that limit a relative coordinate.
#pragma once

#include <limits>

#include "dynamics/forces/coordinate_force.hpp"

namespace espalier::dynamics {

/// Contact at the ends of a range. With the penetration p > 0 beyond an end and its rate p': N(p) (1 + a p'), never
/// negative, N(p) the smoothed penalty of forces/penalty.hpp (Hunt and Crossley, J. Appl. Mech. 42 (1975): damping that
/// grows with the penetration, so that the force begins and ends with zero and does not stick).
/// A mass that hits a stop with speed v leaves it with w, a v - ln(1 + a v) = -a w - ln(1 - a w), whatever N(p) is
/// (integrate m p' dp' / (1 + a p') = -N dp to and fro); w / v is nearly 1 - 2/3 a v for small a v.
struct StopLaw {
  double lower = -std::numeric_limits<double>::infinity();
  double upper = std::numeric_limits<double>::infinity();
  double stiffness = 0;  ///< k of N(p)
  double damping = 0;    ///< a, time per length (of angles: time)
  double smoothing = 1;  ///< e of N(p): length (or angle) over which the stiffness builds up
};

/// @throws std::invalid_argument where stiffness or smoothing is not positive, damping is negative, or the range empty
[[nodiscard]] std::unique_ptr<CoordinateLaw> stop_law(const StopLaw& law);

}  // namespace espalier::dynamics

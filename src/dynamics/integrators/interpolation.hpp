/// \file
/// States between the ends of a step, for pictures.
#pragma once

#include "dynamics/dae/equations.hpp"

namespace espalier::dynamics {

/// The state at t between two states of one motion: in the chart around the first, cubic through the places and
/// velocities of both (Hermite), so q is good to O(h^4) and v, its derivative, to O(h^3). Accelerations and multipliers
/// lie on the line between those of both. Constraints hold to the same orders, not to the integrator's tolerance.
[[nodiscard]] State between(const System& system, const State& a, const State& b, double t);

}  // namespace espalier::dynamics

// Andrews' squeezing mechanism as a system with hand-written derivatives (IVP test set, Bari; index 3, n = 7, m = 6).
// Equations, parameters, initial values and the reference at t = 0.03 (PSIDE, tolerance 1e-14) are the published ones.
#pragma once

#include <array>

#include "dynamics/dae/equations.hpp"
#include "dynamics/dae/function_system.hpp"

namespace espalier::dynamics {

[[nodiscard]] DaeFunctions andrews_functions();
/// The published initial state.
[[nodiscard]] State andrews_start();
/// q, v, a, lambda at t = 0.03: 27 values.
[[nodiscard]] const std::array<double, 27>& andrews_reference();
/// Kinetic energy + spring energy - moment * beta, which the motion conserves.
[[nodiscard]] double andrews_energy(const StateView& s);

}  // namespace espalier::dynamics

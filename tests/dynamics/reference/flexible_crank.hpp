// Simeon's flexible slider crank (IVP test set, "crank"): rigid crank of prescribed speed, elastic connecting rod with
// two bending modes and two longitudinal nodes. Coordinates phi1, phi2, x3, q1 ... q4; three constraints.
#pragma once

#include <array>

#include "dynamics/dae/equations.hpp"
#include "dynamics/dae/function_system.hpp"

namespace espalier::dynamics {

[[nodiscard]] DaeFunctions flexible_crank_functions();
/// The test set's initial values on the slow motion, x3 and the velocity of phi2 put onto the constraints (they are
/// printed to 9 digits; the defects are 2e-10 m and 6e-10 m/s).
[[nodiscard]] State flexible_crank_start();
/// The values at t = 0.1 in extended precision: the index-1 form as an ordinary differential equation, extrapolated.
[[nodiscard]] std::array<double, 24> flexible_crank_truth(int steps);
/// Published values at t = 0.1 (MEBDFI, tolerance 1e-14, index 2): 7 positions, 7 velocities, 7 accelerations, 3
/// multipliers.
[[nodiscard]] const std::array<double, 24>& flexible_crank_reference();

}  // namespace espalier::dynamics

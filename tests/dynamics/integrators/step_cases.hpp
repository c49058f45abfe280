/// \file
/// Six mechanisms for tables of error against step, and their truth: rigid and flexible, in functions and in
/// components, with and without quaternions, slow, fast and driven. Shared by the tests and by
/// bench/dynamics/step_errors.cpp.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "dynamics/dae/equations.hpp"

namespace espalier::dynamics {

struct StepCase {
  std::string name;   ///< one word
  std::string title;  ///< for people
  std::unique_ptr<System> system;
  State start;       ///< consistent
  double end = 0;    ///< s
  double truth = 0;  ///< length of the steps of the truth, s
  /// Where places stand that other programs know too: three numbers each in q, and in v and a.
  std::vector<std::pair<std::size_t, std::size_t>> points = {};
};

/// Spatial slider crank of the IFToMM library: three bodies with quaternions, all four kinds of joints needed.
[[nodiscard]] StepCase spatial_slider_crank();
/// Car axis of the IVP test set (Bari): constraints that depend on time, stiff springs, multipliers of 1e-3.
[[nodiscard]] StepCase car_axis();
/// The slider crank of SUNDIALS' examples (idasSlCrank_dns): spring and damper.
[[nodiscard]] StepCase sundials_slider_crank();
[[nodiscard]] DaeFunctions sundials_slider_crank_functions();
/// Andrews' squeezing mechanism (andrews.hpp).
[[nodiscard]] StepCase andrews_mechanism();
/// Heavy top that spins at 150 rad/s.
[[nodiscard]] StepCase heavy_top();
/// The flexible pendulum of Gerstmayr and Shabana (2006): four ANCF cables, hinged at one end, thrown.
[[nodiscard]] StepCase flexible_pendulum();

[[nodiscard]] std::vector<StepCase (*)()> step_cases();

/// The motion from `from` to `until` by another way than the integrators': the accelerations as functions of q and v
/// (index 1), in the chart around the last point, by Gragg's extrapolation of order 12 with steps of `length`; q and v
/// are put back on the constraints after each. Good to 1e-12 and less, see the test of the truth.
[[nodiscard]] State index_one_truth(System& system, State from, double until, double length);

/// Errors of a state, each the largest difference over the largest number of its kind.
struct StepErrors {
  double q = 0, v = 0, a = 0, lambda = 0;
};
[[nodiscard]] StepErrors step_errors(const System& system, const State& s, const State& truth);

}  // namespace espalier::dynamics

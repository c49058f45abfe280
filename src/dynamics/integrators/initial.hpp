/// \file
/// States at one instant: consistent initial conditions.
#pragma once

#include <vector>

#include "dynamics/dae/equations.hpp"

namespace espalier::dynamics {

struct ConsistencyOptions {
  /// The tolerance of the constraints: Phi in parts of constraint_sizes(), the velocity level times 10 max(1, |v|).
  double tolerance = 1e-12;
  int max_iterations = 30;
  double allowed_position = 1e300;  ///< a larger change |dq| of the given configuration is an error
  double allowed_velocity =
      1e300;  ///< a larger change |dv| of the given velocities is an error (contradictory velocities)
  /// Velocities that are to stay as they are where the constraints allow for it, while the others follow: n marks.
  /// Empty: all count alike.
  std::vector<char> kept_velocities;
};

struct ConsistencyResult {
  double position_change = 0;  ///< largest entry of all dq together
  double velocity_change = 0;  ///< largest entry of dv
  int iterations = 0;
  Levels levels;
};

/// Marks of velocity coordinates that are lengths, not angles or gradients.
[[nodiscard]] std::vector<char> length_coordinates(const System& system, ConstSpan q);
/// A typical size of each velocity coordinate: 1 of angles and gradients, the extent of the model of lengths. n
/// numbers.
[[nodiscard]] std::vector<double> coordinate_sizes(const System& system, ConstSpan q);

/// How large the terms are that each constraint equation adds up, sum_j |Phi_q_ij| size_j, and not below 1e-4 of the
/// largest: what rounding leaves of an equation goes with it, whatever the units. m numbers.
/// @param phi_q  values on the constraint pattern
[[nodiscard]] std::vector<double> constraint_sizes(System& system, ConstSpan q, ConstSpan phi_q);

/// Makes a state consistent: the nearest configuration (in the metric of the mass matrix) that satisfies Phi = 0, the
/// nearest velocities that satisfy the velocity level (nearest to it those that are to be kept), then accelerations and
/// multipliers from the equations of motion.
/// @throws espalier::Error naming the constraint with the largest violation if no such state is found
ConsistencyResult make_consistent(Equations& equations, State& state, const ConsistencyOptions& options = {});

}  // namespace espalier::dynamics

/// \file
/// States at one instant: consistent initial conditions, small vibrations.
#pragma once

#include <Eigen/Core>
#include <complex>
#include <string>
#include <vector>

#include "dynamics/dae/equations.hpp"

namespace espalier::dynamics {

struct ConsistencyOptions {
  double tolerance = 1e-12;  ///< of the constraints: Phi absolute, the other levels times max(1, |v|), max(1, |a|)
  int max_iterations = 30;
  double allowed_position = 1e300;  ///< a larger change |dq| of the given configuration is an error
  double allowed_velocity =
      1e300;  ///< a larger change |dv| of the given velocities is an error (contradictory velocities)
};

struct ConsistencyResult {
  double position_change = 0;  ///< largest entry of all dq together
  double velocity_change = 0;  ///< largest entry of dv
  int iterations = 0;
  Levels levels;
};

/// Makes a state consistent: the nearest configuration (in the metric of the mass matrix) that satisfies Phi = 0, the
/// nearest velocities that satisfy the velocity level, then accelerations and multipliers from the equations of motion.
/// @throws espalier::Error naming the constraint with the largest violation if no such state is found
ConsistencyResult make_consistent(Equations& equations, State& state, const ConsistencyOptions& options = {});

/// One mode of the linearised system.
struct Mode {
  std::complex<double> eigenvalue;  ///< exp(eigenvalue t), 1/s
  double frequency = 0;             ///< |imaginary part| / (2 pi), Hz
  double damping_ratio = 0;         ///< -real / |eigenvalue|
  /// n numbers, a velocity: the real part of the shape, turned so that the largest component is real and 1.
  std::vector<double> shape;
};

/// Eigenvalues of M x'' + D x' + C x = 0 on the tangent space of the constraints at a state (normally an equilibrium),
/// sorted by modulus, one of each conjugate pair. Dense: O(n^3), for n up to about a thousand.
std::vector<Mode> eigenfrequencies(Equations& equations, const State& state);

/// The shape of a mode. @param x  complex, n numbers
std::vector<double> real_shape(const Eigen::VectorXcd& x);

}  // namespace espalier::dynamics

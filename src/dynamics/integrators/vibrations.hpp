/// \file
/// The lowest modes of a linearised system of any size.
#pragma once

#include <Eigen/Core>
#include <array>
#include <complex>
#include <string>
#include <vector>

#include "dynamics/dae/equations.hpp"
#include "espalier/modes.hpp"

namespace espalier::dynamics {

/// One mode of the linearised system.
struct Mode {
  std::complex<double> eigenvalue;  ///< exp(eigenvalue t), 1/s
  double frequency = 0;             ///< |imaginary part| / (2 pi), Hz
  double damping_ratio = 0;         ///< -real / |eigenvalue|
  /// n numbers, a velocity: the real part of the shape, turned so that the largest component is real and 1.
  std::vector<double> shape;
};

struct Vibrations {
  std::vector<Mode> modes;  ///< by modulus, one of each conjugate pair
  std::string notice;       ///< what is not exact about them; empty: nothing
};

/// The `count` lowest modes of M x'' + D x' + C x = 0 on the tangent space of the constraints at a state (normally an
/// equilibrium), fewer where the system has fewer. A motion that nothing resists is one mode with the eigenvalue 0,
/// negative stiffness one with frequency 0 and the exponent that grows.
///
/// The modes of M and the symmetric part of C come first, with the constraints as multipliers: of small systems all of
/// them, by a dense method whose lowest are exact whatever the range of the spectrum (modes/dense_symmetric.hpp); else
/// by espalier::find_modes(). Where there are velocity-dependent forces, or C is not symmetric, the problem is
/// projected on them: all, or three times as many as asked for and 40 more (modal projection: R. Craig, A. Kurdila,
/// "Fundamentals of Structural Dynamics", 2006, chapters 10 and 11); `notice` says how much eigenvalues change with the
/// size of that space. What rounding of the stiffness hides is given as 0, or as it is, with a notice of how far it may
/// be off.
/// @param solver  device, threads, memory, interruption
/// @param structural  H, in the pattern of W: eigenvalues are those of M x'' + D x' + (C + i H) x = 0 with a positive
/// imaginary part, in the space of three times as many undamped modes as asked for and 40 more. Null: none
/// @throws Error where they cannot be found
Vibrations small_vibrations(Equations& equations, const State& state, Index count, const Options& solver,
                            const SparseMatrix* structural = nullptr);

/// The lowest modes of M and the symmetric part of C alone, as above.
struct UndampedModes {
  Eigen::VectorXd squares;  ///< of angular frequencies; 0 where rounding leaves nothing else
  Eigen::MatrixXd shapes;   ///< n rows; x^T M x = 1
};
UndampedModes undamped_vibrations(Equations& equations, const State& state, Index count, const Options& solver);

/// The same by either way. @param solver  null: the dense method, O(n^3)
Vibrations small_vibrations_by(Equations& equations, const State& state, Index count, const Options* solver);

/// Systems with a parameter below and above its value (p -+ step), each with its state.
struct PencilSides {
  double step = 0;
  std::array<Equations*, 2> equations;
  std::array<const State*, 2> states;
};

struct FrequencySlopes {
  std::vector<double> frequencies;  ///< lowest first
  std::vector<double> derivatives;  ///< by each parameter, a row for each frequency
};

/// The lowest frequencies without damping, and how they change: l' = x^T (K' - l M') x with x^T M x = 1, multipliers
/// and rows of constraints included (R. L. Fox, M. P. Kapoor, AIAA Journal 6, 1968). Modes of one frequency: the
/// eigenvalues of X^T (K' - l M') X. K' and M' are central differences of the tangents.
[[nodiscard]] FrequencySlopes frequency_slopes(Equations& equations, const State& state, Index count,
                                               const std::vector<PencilSides>& parameters, const Options& solver);

}  // namespace espalier::dynamics

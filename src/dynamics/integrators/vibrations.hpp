/// \file
/// The lowest modes of a linearised system of any size.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "dynamics/integrators/initial.hpp"
#include "espalier/modes.hpp"

namespace espalier::dynamics {

struct Vibrations {
  std::vector<Mode> modes;  ///< by modulus
  std::string notice;       ///< what is not exact about them; empty: nothing
};

/// The `count` lowest modes of M x'' + D x' + C x = 0 on the tangent space of the constraints at a state, by
/// espalier::find_modes() of C and M with the constraints as multipliers: fewer where the system has fewer. Where there
/// are velocity-dependent forces, or C is not symmetric, in the space of the lowest modes of M and the symmetric part
/// of C, three times as many and 40 more (modal projection: R. Craig, A. Kurdila, "Fundamentals of Structural
/// Dynamics", 2006, chapters 10 and 11); `notice` says how much the frequencies change with the size of that space. A
/// mode of negative stiffness has frequency 0 and the exponent that grows.
/// @param solver  device, threads, memory, interruption
/// @throws Error where they cannot be found
Vibrations small_vibrations(Equations& equations, const State& state, Index count, const Options& solver);

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

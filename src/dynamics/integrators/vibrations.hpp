/// \file
/// The lowest modes of a linearised system of any size.
#pragma once

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

}  // namespace espalier::dynamics

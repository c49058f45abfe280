/// \file
/// Why the joints of a model cannot all be closed: which one asks for what the mechanism does not reach, and by how
/// much.
#pragma once

#include <optional>
#include <string>

#include "dynamics/dae/equations.hpp"
#include "dynamics/model/mechanism.hpp"

namespace espalier::dynamics::model {

/// A sentence about the joints that stay open in the nearest positions at the time of the state; nothing where they all
/// close, and in large models (more than 1e8 for the square of the constraints times the velocities).
/// @param units of the model, or empty
[[nodiscard]] std::optional<std::string> unclosed_joints(Mechanism& mechanism, const State& state,
                                                         const std::string& units);

/// The same where joints and supports that are led by functions of time ask, from some time up to `until` on, for what
/// the mechanism does not reach from the state; with that time. Nothing without such functions.
[[nodiscard]] std::optional<std::string> unreached_motion(Mechanism& mechanism, const State& state, double until,
                                                          const std::string& units);

}  // namespace espalier::dynamics::model

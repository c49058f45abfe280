/// \file
/// Which bodies nothing holds, and in which directions.
#pragma once

#include <string>
#include <vector>

#include "dynamics/dae/equations.hpp"
#include "dynamics/model/mechanism.hpp"

namespace espalier::dynamics::model {

/// A text for every body that can move as a whole without a joint, a spring or another body's stiffness against it, for
/// instance "'bob' can turn about z through (0, 0, 1)": the null space of [F_q; Phi_q], at a state and the present load
/// factor, in motions of whole bodies. A spring counts from 1e-12 of the stiffness of what it acts on.
/// Empty where every body is held, and for models that are too large to look at (dense, some hundred bodies).
/// @param dropped constraints that are left out (redundant, switched off): one mark each, or empty
[[nodiscard]] std::vector<std::string> free_motions(Mechanism& mechanism, const std::vector<char>& dropped,
                                                    const State& state);

}  // namespace espalier::dynamics::model

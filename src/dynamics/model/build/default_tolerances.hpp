/// \file
/// Tolerances of models that state none.
#pragma once

#include "dynamics/dae/equations.hpp"
#include "dynamics/model/mechanism.hpp"

namespace espalier::dynamics::model {

/// Whether a motion wants them: BDF with steps that are found, where no tolerance is stated.
[[nodiscard]] bool wants_default_tolerances(const IntegratorSpec& integrator);

/// Makes them from the model: its extent (bodies and what they are joined to, at the start), the duration of the run,
/// and whether stiff vibrations are to be expected, which flexible bodies have; those get order 2 unless an order is
/// stated, or damping ends them. Flexible bodies that only vibrate about where they are held count as large as they
/// move: as far as one long implicit step of the linearised equations says. The units do not matter: in others the
/// steps are the same.
/// @param state  consistent, at the start
/// @param duration  of the run as the text has it; may be infinite
void set_default_tolerances(IntegratorSpec& integrator, Equations& equations, const Mechanism& mechanism,
                            const Description& model, const State& state, double duration);

}  // namespace espalier::dynamics::model

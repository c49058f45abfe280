/// \file
/// Finite-difference check of everything a system claims about its derivatives.
#pragma once

#include "dynamics/dae/equations.hpp"
#include "espalier/dae.hpp"

namespace espalier::dynamics {

/// Checks at a state, which need not satisfy any equation. Costs O(n) evaluations; for n up to some thousands.
[[nodiscard]] JacobianCheck check_jacobians(System& system, const State& s);

}  // namespace espalier::dynamics

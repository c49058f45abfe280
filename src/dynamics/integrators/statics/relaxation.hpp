/// \file
/// Equilibrium of what no load path leads to: mechanisms that swing to their place, slack cables.
#pragma once

#include "dynamics/integrators/statics/static_problem.hpp"
#include "dynamics/integrators/statics/statics.hpp"

namespace espalier::dynamics {

struct RelaxationResult {
  bool converged = false;
  bool runs_away = false;  ///< something moved many times the size of the system: nothing holds it
  int iterations = 0, factorizations = 0, failures = 0;
  StaticIncrement last;  ///< step
};

/// Pseudo-transient continuation (Kelley and Keyes 1998): Newton with K + F_a / tau^2 at the whole load, tau growing to
/// infinity as the residual falls, so that it starts like a motion from rest and ends like Newton. Steps that turn
/// elements inside out, or are longer than a third of the system, are tried again with a smaller tau.
RelaxationResult relax(StaticProblem& problem, StaticPoint& x, const StaticsOptions& options);

}  // namespace espalier::dynamics

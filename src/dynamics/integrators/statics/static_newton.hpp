/// \file
/// Newton's method for one point of the path: at a given load, or on a plane that cuts the path.
#pragma once

#include "dynamics/integrators/statics/static_problem.hpp"

namespace espalier::dynamics {

/// Metric of the path: |dq|^2 / scale^2 + dshare^2, and the plane normal to a direction in it.
struct StaticPlane {
  StaticIncrement normal;  ///< of length one
  double scale = 1;        ///< |dq| that counts as much as the whole load
};

enum class StaticOutcome {
  converged,
  not_finite,   ///< at its start: inverted elements, forces that are no numbers
  singular,     ///< K
  no_progress,  ///< no part of Newton's step gets nearer
  too_many,     ///< iterations
  other_branch  ///< it converged, but not to a point of this path
};

struct StaticNewtonResult {
  StaticOutcome outcome = StaticOutcome::converged;
  int iterations = 0;
  int factorizations = 0;
  double first = 0;  ///< length of the first correction or of a longer one that was taken although the level rose, in
                     ///< the metric of the plane (a given load: |dq|)
};

/// Corrects x until it is balanced. Steps are halved until the next correction with the same K is shorter (the natural
/// level; Deuflhard 2004, (3.27)). @param plane null: at x.share @param tolerance of StaticProblem::balanced()
/// @param most_iterations then it gives up
StaticNewtonResult correct(StaticProblem& problem, StaticPoint& x, const StaticPlane* plane, double tolerance,
                           int most_iterations);

}  // namespace espalier::dynamics

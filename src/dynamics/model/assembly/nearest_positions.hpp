/// \file
/// The configuration in which constraints are violated least: where they have no solution, and Newton's iteration runs
/// off.
#pragma once

#include <vector>

#include "dynamics/dae/system.hpp"

namespace espalier::dynamics::model {

struct NearestPositions {
  std::vector<double> q;
  std::vector<double> phi;   ///< m: violations there
  std::vector<double> part;  ///< m: these over the size of the terms of each equation (constraint_sizes()), unweighted
  int iterations = 0;
  bool exhausted = false;  ///< the search was ended by the number of its iterations: these are no nearest positions
};

/// Equations that follow each other: those of a joint.
struct RowRange {
  std::size_t first = 0, count = 0;
  [[nodiscard]] bool has(std::size_t row) const { return row >= first && row < first + count; }
};

/// Minimises the sum of (weight_i Phi_i / size_i)^2 by Levenberg and Marquardt's method (Marquardt, J. SIAM 11 (1963)),
/// from q on. Dense in the number of constraints, m.
/// @param weights m; 0: the equation does not count
[[nodiscard]] NearestPositions nearest_positions(System& system, double t, ConstSpan q, ConstSpan weights);

/// The same of the rows `last` alone, among the positions that satisfy all others: steps in the null space of the
/// others, each followed by a return to them. Where the others have no solution it is what nearest_positions() finds of
/// them.
[[nodiscard]] NearestPositions nearest_positions(System& system, double t, ConstSpan q, ConstSpan weights,
                                                 const RowRange& last);

}  // namespace espalier::dynamics::model

/// \file
/// Rank of a small matrix, told by the matrix itself (zeros_of_dense()), for those who know it by a factor.
#pragma once

#include "solver/deficiency/null_space_iteration.hpp"

namespace espalier::solver {

/// Whether a small matrix has so many zeros as its factor says, or cannot tell: a factor of poor pivots may look
/// regular. Of others nothing is asked.
[[nodiscard]] bool agrees_with_dense(const NullSpaceIteration& search, Index zeros);

}  // namespace espalier::solver

/// \file
/// Ranks that share a plan, one device each: what each keeps, and to whom what it makes has to go. All of it follows
/// from the plan, so that nobody asks for anything.
#pragma once

#include <vector>

#include "plan/plan.hpp"

namespace espalier::plan {

/// Whether a rank keeps the factor of a front: it lies in one of its sub-trees, or in the top above one of them.
bool keeps_factor(const Plan& plan, Index front, Index rank);

/// The ranks that keep the factor of a front, ascending.
std::vector<Index> keepers(const Plan& plan, Index front);

/// The rank that makes column `column` of a front (all of a front that is taken whole).
Index maker(const Plan& plan, Index front, Index column);

/// The ranks that gather from a contribution, ascending: from its tile column `column` (from 0 below the pivots), or of
/// a front that is taken whole from all of it (-1). Empty for a root.
std::vector<Index> readers(const Plan& plan, Index front, Index column);

/// Places of what one rank keeps or works with: its sub-trees with memory that is used again, then the top fronts whose
/// factors it keeps and the contributions that it makes or receives for them, each with a place of its own. Places of
/// other fronts have no meaning.
MemoryPlan memory_of_rank(const Plan& plan, Index rank);

}  // namespace espalier::plan

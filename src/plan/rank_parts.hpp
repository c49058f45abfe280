/// \file
/// Ranks that share a plan, one device each: what each keeps and knows, and to whom what it makes has to go. All of it
/// follows from what every rank knows of the plan, so that nobody asks for anything.
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

/// Whether a rank has the rows and numbers the tiles of a front: it keeps the factor, or that of the parent in the top,
/// to which the front's contribution goes, in a factorization or in a solve.
bool knows(const Plan& plan, Index front, Index rank);

/// The first rank that keeps the factor of a front: who tells others about it.
Index first_keeper(const Plan& plan, Index front);

/// Whether the plan's own rank makes column `column` of a front; with one rank, true.
bool is_made_here(const Plan& plan, Index front, Index column);

/// Numbers the rows and tiles of the fronts that the plan's rank knows: fills row_begin and first_tile. Other fronts
/// have none. @pre tree, layout, whole, ownership
void number_known(Plan& plan);
/// Keeps of tree.rows what row_begin numbers.
void drop_unknown_rows(Plan& plan);

/// Places of what the plan's rank keeps or works with: its sub-trees with memory that is used again, then the top
/// fronts whose factors it keeps and the contributions that it makes or receives for them, each with a place of its
/// own. Places of other fronts have no meaning. @pre its tasks, and `relative`
MemoryPlan memory_of_rank(const Plan& plan);

}  // namespace espalier::plan

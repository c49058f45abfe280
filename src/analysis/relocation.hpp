/// \file
/// Static delayed pivoting: columns that could not be eliminated where the tree has them move to later fronts.
#pragma once

#include <span>
#include <vector>

#include "analysis/assembly_tree.hpp"
#include "base/thread_pool.hpp"

namespace espalier::analysis {

/// The column at `position` (a place in tree.order) is to be eliminated in `front`.
struct PivotMove {
  Index position = 0;
  Index front = 0;  ///< an ancestor of the front that has it, or that front itself
};

/// Moves each pivot to the end of the pivots of its new front; columns that arrive in one front stand in the order of
/// their old positions. The fronts on the way hand the column on as one of their rows below. A front that loses all its
/// pivots disappears: its children become children of its parent, and what they hand on stays the same. Positions are
/// renumbered; the result is a postordered tree that is valid for the same matrix.
/// @param moves  of distinct positions
/// @param pool   shares the rows; null: the calling thread alone
/// @returns by front of the new tree: which one it was before
std::vector<Index> relocate_pivots(AssemblyTree& tree, std::span<const PivotMove> moves,
                                   base::ThreadPool* pool = nullptr);

/// To the parents of their fronts; columns of a root to the end of its own pivots.
std::vector<PivotMove> one_front_up(const AssemblyTree& tree, std::span<const Index> positions);

}  // namespace espalier::analysis

/// \file
/// Static delayed pivoting: columns that could not be eliminated where the tree has them move one front up.
#pragma once

#include <span>

#include "analysis/assembly_tree.hpp"

namespace espalier::analysis {

/// Moves the columns at `positions` (distinct places in tree.order) from the pivots of their front to the end of the
/// pivots of its parent; columns of a root go to the end of the root's own pivots. Columns that arrive in one front
/// stand in the order of their old positions. A front that loses all its pivots disappears: its children become
/// children of its parent, and what they hand on stays the same. Positions are renumbered; the result is a postordered
/// tree that is valid for the same matrix.
void relocate_pivots(AssemblyTree& tree, std::span<const Index> positions);

}  // namespace espalier::analysis

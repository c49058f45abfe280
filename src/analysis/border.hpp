/// \file
/// Rows beside a matrix that are never eliminated: what is left for them is their Schur complement.
#pragma once

#include <span>

#include "analysis/assembly_tree.hpp"

namespace espalier::analysis {

/// An entry that couples an unknown, by its position, with a row (or column) of the border.
struct BorderEntry {
  Index position;
  Index row;  ///< 0 .. size - 1
};

/// Adds a border of `size` rows to a tree that has none: each front gets the rows that its pivots, or fronts below it,
/// are coupled with. The last root that any are coupled with adopts all roots before it, so that one contribution holds
/// all that is left for the border.
void add_border(AssemblyTree& tree, Index size, std::span<const BorderEntry> links);

/// The front whose contribution that is; -1: nothing is coupled with the border.
Index border_root(const AssemblyTree& tree);

}  // namespace espalier::analysis

/// \file
/// An assembly tree that follows a change of the pattern: only fronts that the change touches become others.
#pragma once

#include <span>
#include <utility>
#include <vector>

#include "analysis/assembly_tree.hpp"
#include "base/thread_pool.hpp"
#include "espalier/matrix.hpp"
#include "matrix/row_index.hpp"

namespace espalier::analysis {

/// How the pattern of a matrix has changed. Unknowns are those of AssemblyTree::order.
struct PatternChange {
  using Edge = std::pair<Index, Index>;
  std::vector<Edge> added, removed;        ///< of the graph, each in one direction at least; u != v
  std::vector<Index> diagonal;             ///< unknowns whose diagonal entry came or went
  const MatrixView& a;                     ///< as it is now
  const matrix::RowIndex& rows;            ///< of `a`; empty where both triangles are stored
  std::span<const Index> row_of_col = {};  ///< the row matched to each column; empty: its own
};

struct ChangedTree {
  AssemblyTree tree;
  Index moved = 0;  ///< unknowns that went up into a separator
  Index kept = 0;   ///< fronts with the same pivots and rows as before
  /// By front: that with the same pivots, rows and neighbours in the same order before; -1: none.
  std::vector<Index> same;
  /// By front: that with the same pivots in the same order before, of whose entries only those of the change came or
  /// went; -1: none.
  std::vector<Index> with_pivots;
};

/// An edge between unknowns of which neither's front lies above the other's would couple what a separator holds apart.
/// One of the two goes up into the front in which their ways to the root meet: the separator, which is thicker there.
/// Which one: that whose way up costs less, over the number of such edges that it has. Trees that an edge joins become
/// one. Then the rows of the fronts that lost or won pivots or neighbours are made anew, and of those above them as far
/// as anything changes. All other fronts stay as they are; so does the order within them.
ChangedTree change_tree(const AssemblyTree& before, const PatternChange& change, base::ThreadPool& pool);

}  // namespace espalier::analysis

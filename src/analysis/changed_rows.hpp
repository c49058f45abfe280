/// \file
/// The rows of the fronts of a tree that follows a change of the pattern: the end of change_tree().
#pragma once

#include <span>
#include <vector>

#include "analysis/tree_change.hpp"
#include "base/at.hpp"

namespace espalier::analysis {

/// What has become of a front, bits.
enum FrontChange : char {
  kRows = 1,     ///< rows below its pivots may be others
  kEntries = 2,  ///< entries of the matrix in it came or went
  kPivots = 4,   ///< it has won or lost pivots
  kMoved = 8,    ///< entries that others had stand in it now
};

/// Fronts whose pivots are settled.
struct FollowedFronts {
  const AssemblyTree& before;
  const PatternChange& change;
  const std::vector<Index>& was;                  ///< fronts; their numbers before
  const std::vector<Index>& front;                ///< by unknown
  const std::vector<Index>& position;             ///< by unknown
  const std::vector<Index>& column_of_row;        ///< empty: identity
  std::vector<char>& touched;                     ///< fronts; FrontChange bits. Written: what follows for those above
  std::span<const PatternChange::Edge> new_rows;  ///< edges whose upper end may be a new row of the lower one's front
};

/// Fills in all of `out` but ChangedTree::moved. @pre out.tree has its order, its fronts and their parents
void make_rows(const FollowedFronts& fronts, ChangedTree& out, base::ThreadPool& pool);

/// Calls use(u) for all neighbours u of v in the graph of the matrix as it is now, and for v itself.
template <class Use>
void visit_neighbours(const PatternChange& change, const std::vector<Index>& column_of_row, Index v, Use&& use) {
  const MatrixView& a = change.a;
  for (Offset q = a.col_ptr[at(v)]; q < a.col_ptr[at(v) + 1]; ++q) {
    const Index r = a.row_ind[at(q)];
    use(column_of_row.empty() ? r : column_of_row[at(r)]);
  }
  const auto& ptr = change.rows.ptr;
  if (ptr.empty()) return;
  const std::size_t row = at(change.row_of_col.empty() ? v : change.row_of_col[at(v)]);
  for (Offset q = ptr[row]; q < ptr[row + 1]; ++q) use(change.rows.col[q]);
}

}  // namespace espalier::analysis

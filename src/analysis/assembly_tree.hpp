/// \file
/// The assembly tree: which columns are eliminated together (fronts), in which order, and what each front hands on.
#pragma once

#include <algorithm>
#include <vector>

#include "base/lazy_vector.hpp"
#include "espalier/types.hpp"

namespace espalier::analysis {

/// Fronts in postorder (every child stands before its parent). A *position* is a place in the elimination order; a
/// front's pivots occupy consecutive positions.
struct AssemblyTree {
  Index n = 0;                  ///< unknowns
  Index border = 0;             ///< rows beside them that are never eliminated, positions n .. n + border - 1
  std::vector<Index> order;     ///< n; order[k] is the caller's column eliminated at position k
  std::vector<Index> first;     ///< fronts + 1; front f eliminates the positions first[f] .. first[f + 1] - 1
  std::vector<Index> parent;    ///< fronts; the parent front, -1 for a root; parent[f] > f
  std::vector<Offset> row_ptr;  ///< fronts + 1; into `rows`
  base::LazyVector<Index>
      rows;  ///< positions of the rows below the pivots of each front, ascending; all of them are
             ///< pivots of ancestors or of the border, and contained in the parent's pivots and rows

  [[nodiscard]] Index fronts() const { return static_cast<Index>(parent.size()); }
  [[nodiscard]] Index pivots(Index f) const { return first[f + 1] - first[f]; }
  [[nodiscard]] Index rows_below(Index f) const { return static_cast<Index>(row_ptr[f + 1] - row_ptr[f]); }
  /// How many of the front's rows, its last ones, belong to the border.
  [[nodiscard]] Index border_rows(Index f) const {
    if (border == 0) return 0;
    const auto end = rows.begin() + row_ptr[f + 1];
    return static_cast<Index>(end - std::lower_bound(rows.begin() + row_ptr[f], end, n));
  }
};

}  // namespace espalier::analysis

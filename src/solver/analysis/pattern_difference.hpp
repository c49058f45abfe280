/// \file
/// Where two patterns of a matrix differ, and what stays of the one in the other.
#pragma once

#include <memory>
#include <vector>

#include "analysis/tree_change.hpp"
#include "base/thread_pool.hpp"
#include "espalier/matrix.hpp"
#include "matrix/row_index.hpp"
#include "plan/kept_entries.hpp"

namespace espalier::solver {

struct PatternDifference {
  using Entry = analysis::PatternChange::Edge;  ///< (row, column)
  std::vector<Entry> added, removed;            ///< by columns, ascending
  std::vector<Index> columns;                   ///< in which entries came, went, or stand in another order
  plan::SourceMap now;                          ///< where the entries of before stand now; -1: they are gone
};

/// @pre as many columns; of each entry one (PreparedMatrix)
PatternDifference compare_patterns(const MatrixView& before, const MatrixView& now, base::ThreadPool& pool);

/// The index of `now` from that of `before`: sources have moved, some entries have gone, others come in between.
std::shared_ptr<const matrix::RowIndex> follow_rows(const matrix::RowIndex& was, const MatrixView& before,
                                                    const MatrixView& now, const PatternDifference& difference,
                                                    base::ThreadPool& pool);

}  // namespace espalier::solver

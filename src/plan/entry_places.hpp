/// \file
/// Where the entries of the caller's matrix go: fills plan.entries and plan.entry_ptr.
#pragma once

#include <span>
#include <vector>

#include "base/thread_pool.hpp"
#include "matrix/row_index.hpp"
#include "plan/plan.hpp"

namespace espalier::plan {

/// The matrix of a plan; see make_plan().
struct EntrySource {
  const MatrixView& a;
  const matrix::RowIndex& rows;
  const std::vector<Index>& row_of_col;
};

/// @pre tree, layout, whole, first_tile
void place_entries(Plan& plan, const EntrySource& from, base::ThreadPool& pool, const KeptEntries* kept = nullptr);

/// Fills plan.sources, and says in entries where in it their values stand.
void number_sources(Plan& plan, base::ThreadPool& pool);

/// The same where most fronts have the columns, rows and tiles of a front of another plan of this matrix, whose entries
/// are copied.
/// @param same  by front: that front of `before`, ascending; -1: the front is another one
void place_entries_as_before(Plan& plan, const Plan& before, std::span<const Index> same, const EntrySource& from,
                             base::ThreadPool& pool);

}  // namespace espalier::plan

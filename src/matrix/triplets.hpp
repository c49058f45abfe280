/// \file
/// Assembly: coordinate entries in any order to compressed columns.
#pragma once

#include <span>

#include "base/thread_pool.hpp"
#include "espalier/matrix.hpp"

namespace espalier::matrix {

/// Entries (row[k], col[k], value[k]) of a rows x cols matrix, 0-based, in any order, repeats allowed; owns nothing.
struct TripletView {
  Index rows = 0;
  Index cols = 0;
  std::span<const Index> row;
  std::span<const Index> col;
  std::span<const double> value;  ///< as long as row and col, or empty for a pattern
  /// general, or symmetric_lower: an entry above the diagonal is then taken for its mirror image below
  Storage storage = Storage::general;
};

/// Sorts the entries into columns, rows rising, repeated entries summed in the order in which they came (for a pattern:
/// taken once). Explicit zeros stay. The result does not depend on the number of threads.
/// Memory: 12 bytes per entry and 16 per column besides the input. Work per thread: one sweep over all entries plus its
/// share of the columns.
/// @param pool may be null
/// @throws std::invalid_argument when the arrays differ in length or the storage is another one
/// @throws Error(invalid_input) when an index is out of range
SparseMatrix to_csc(const TripletView& entries, base::ThreadPool* pool = nullptr);

/// Sorts the rows of every column of `a` and sums repeated entries, in place (a pattern's are taken once).
/// @pre validate(a) would pass
void sum_duplicates_sorted(SparseMatrix& a, base::ThreadPool* pool = nullptr);

/// True when the rows of every column rise strictly.
bool is_sorted_unique(const MatrixView& a);

}  // namespace espalier::matrix

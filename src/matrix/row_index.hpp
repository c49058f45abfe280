/// \file
/// The entries of a matrix by rows: what a pattern in compressed columns does not show.
#pragma once

#include <span>
#include <vector>

#include "base/memory.hpp"
#include "base/thread_pool.hpp"
#include "espalier/matrix.hpp"

namespace espalier::matrix {

/// By rows, each with rising columns as far as the pattern's order of columns goes: all entries (general storage),
/// those off the diagonal (one triangle is stored), those below the diagonal (both are).
struct RowIndex {
  std::vector<Offset> ptr;      ///< rows + 1
  base::Buffer<Index> col;      ///< column of the entry
  base::Buffer<Offset> source;  ///< where it stands in the pattern

  [[nodiscard]] Offset bytes() const {
    return static_cast<Offset>(ptr.size() * sizeof(Offset)) + col.bytes() + source.bytes();
  }
};

/// The rows first .. end - 1 of an index; the others are empty. Of an empty index an empty one.
RowIndex rows_of_index(const RowIndex& whole, Index first, Index end);

/// The same for any number of threads.
RowIndex index_rows(const MatrixView& a, base::ThreadPool& pool);

}  // namespace espalier::matrix

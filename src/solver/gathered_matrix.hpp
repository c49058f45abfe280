/// \file
/// A matrix of which each rank has a part, put together on all of them.
#pragma once

#include <span>
#include <vector>

#include "base/thread_pool.hpp"
#include "espalier/matrix.hpp"
#include "espalier/ranks.hpp"
#include "ranks/link.hpp"

namespace espalier::solver {

/// The parts are the same on all ranks after each call, which are collective; without a link there is one part.
/// What is kept: 8 bytes for each entry of all ranks, to bring new values to their places.
class GatheredMatrix {
 public:
  /// The whole matrix, of the entries that the ranks have; repeated ones are summed in the order of ranks.
  /// @throws Error(invalid_input) on the rank whose part is inconsistent
  SparseMatrix gather(const LocalEntries& part, ranks::Link* link, base::ThreadPool& pool);
  SparseMatrix gather(const LocalRows& part, ranks::Link* link, base::ThreadPool& pool);
  /// The matrix that rank 0 has, whatever the others give.
  SparseMatrix gather(const MatrixView& part, ranks::Link* link);

  /// Values of the whole matrix, from each rank's in the order of its part.
  std::vector<double> gather_values(std::span<const double> part, ranks::Link* link) const;
  /// Right-hand sides: `columns` columns of the rows that this rank has, summed where several have a row.
  /// @throws Error(invalid_input) where a row is missing
  std::vector<double> gather_rows(std::span<const double> part, RowRange rows, Index columns, ranks::Link* link) const;

  [[nodiscard]] Index n() const { return n_; }
  /// Of vectors where the caller says nothing else: the rows of this rank's part; all on rank 0 where rows are
  /// nobody's.
  [[nodiscard]] RowRange rows() const { return rows_; }
  [[nodiscard]] Offset part_entries() const { return part_entries_; }

 private:
  void note_places(const SparseMatrix& whole, std::span<const Index> row, std::span<const Index> col,
                   base::ThreadPool& pool);

  Index n_ = 0;
  RowRange rows_;
  Offset part_entries_ = 0;
  Offset nonzeros_ = 0;         // of the whole matrix
  std::vector<Offset> places_;  // by entry of all ranks, rank after rank; empty: the values of rank 0 as they are
};

}  // namespace espalier::solver

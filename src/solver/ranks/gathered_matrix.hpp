/// \file
/// A matrix of which each rank has a part, put together on all of them.
#pragma once

#include <span>
#include <vector>

#include "base/scalar.hpp"
#include "base/thread_pool.hpp"
#include "espalier/matrix.hpp"
#include "espalier/ranks.hpp"
#include "ranks/communicator.hpp"
#include "solver/analysis/prepared_matrix.hpp"

namespace espalier::solver {

/// What a rank has of a matrix: LocalRows or LocalEntries. As in a GivenMatrix, complex values stand there as their
/// parts, and Hermitian storage is called symmetric.
template <class Local>
struct GivenLocal {
  GivenLocal(const Local& the_a,  // NOLINT(google-explicit-constructor): most are real
             base::Numbers the_numbers = base::Numbers::real)
      : a(the_a), numbers(the_numbers) {}
  Local a;
  base::Numbers numbers;
};
GivenLocal<LocalRows> given(const ComplexLocalRows& part);
GivenLocal<LocalEntries> given(const ComplexLocalEntries& part);

/// The owner of a GivenMatrix.
struct WholeMatrix {
  SparseMatrix a;
  base::Numbers numbers = base::Numbers::real;
  operator GivenMatrix() const { return {a, numbers}; }  // NOLINT(google-explicit-constructor): an owner is a view
};

/// All calls are collective; without a link there is one part. Numbers are passed as in base::Numbers: what has a
/// length in numbers is twice as many doubles of a complex matrix.
///
/// New values go a way that is planned once: the entries of the whole matrix are cut into slices, one a rank; each rank
/// sends every slice's owner its values of it, the owner adds up what comes twice, and all gather the slices. What is
/// kept: 8 bytes for each entry of the rank's part, and for each that falls into its slice.
class GatheredMatrix {
 public:
  /// The whole matrix, of the entries that the ranks have; repeated ones are summed in the order of ranks.
  /// @throws Error(invalid_input) on the rank whose part is inconsistent
  WholeMatrix gather(const GivenLocal<LocalEntries>& part, ranks::Communicator* link, base::ThreadPool& pool);
  WholeMatrix gather(const GivenLocal<LocalRows>& part, ranks::Communicator* link, base::ThreadPool& pool);
  /// The matrix that rank 0 has, whatever the others give.
  WholeMatrix gather(const GivenMatrix& part, ranks::Communicator* link);

  /// Doubles [first, first + values.size()) of the values of the whole matrix.
  struct Slice {
    std::vector<double> values;
    Offset first = 0;
  };
  /// This rank's slice of the values, from each rank's in the order of its part; together the slices are the whole.
  [[nodiscard]] Slice own_slice(std::span<const double> part, ranks::Communicator* link) const;
  /// The whole, of the slices that own_slice() has made.
  static std::vector<double> gather_values(const Slice& own, ranks::Communicator* link);
  /// Right-hand sides: `columns` columns of the rows that this rank has, summed where several have a row.
  /// @throws Error(invalid_input) where a row is missing
  std::vector<double> gather_rows(std::span<const double> part, RowRange rows, Index columns,
                                  ranks::Communicator* link) const;

  [[nodiscard]] Index n() const { return n_; }
  /// The rows of vectors where the caller says nothing else: the rows of this rank's part; all on rank 0 where rows are
  /// nobody's.
  [[nodiscard]] RowRange rows() const { return rows_; }
  [[nodiscard]] Offset part_entries() const { return part_entries_; }
  /// All is rank 0's: its values are those of the whole as they are.
  [[nodiscard]] bool is_of_first() const { return count_.empty(); }

 private:
  void plan_ways(const SparseMatrix& whole, std::span<const std::span<const Index>> row,
                 std::span<const std::span<const Index>> col, int rank, base::ThreadPool& pool);
  [[nodiscard]] Offset slice_begin(std::size_t rank) const;
  template <class Value>
  [[nodiscard]] Slice slice_of(const Value* part, ranks::Communicator* link) const;

  Index n_ = 0;
  base::Numbers numbers_ = base::Numbers::real;
  RowRange rows_;
  Offset part_entries_ = 0;
  Offset nonzeros_ = 0;         // of the whole matrix
  std::vector<Offset> count_;   // for each rank: values that go to its slice. Empty: the values of rank 0 as they are
  std::vector<Offset> order_;   // of the part's entries: slice after slice
  std::vector<char> turned_;    // of the part's entries: conjugates of those of the whole matrix; empty: none
  std::vector<Offset> places_;  // in this rank's slice, of what comes: rank after rank
};

}  // namespace espalier::solver

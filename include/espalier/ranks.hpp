/// \file
/// Several processes that solve one system together, and what each of them knows of it.
#pragma once

#include <complex>
#include <memory>
#include <span>
#include <string>

#include "espalier/ranks.h"
#include "espalier/types.hpp"

namespace espalier {

namespace ranks {
class Communicator;
}

/// Processes (*ranks*) that share solvers. A handle: copies stand for the same ranks, and several solvers may be made
/// on them, as long as all ranks make the same calls on the same solvers in the same order, from one thread.
///
/// `espalier::on(MPI_COMM_WORLD)` of espalier/mpi.h makes one of an MPI communicator.
class Ranks {
 public:
  /// Seconds after which a rank that sends nothing, while others wait for it, counts as lost. Longer than ranks may
  /// come apart between two calls, for instance while one of them reads a file.
  static constexpr double kPatience = 300;

  /// Nobody else: as if there were no ranks.
  Ranks() = default;
  /// Collective. Takes the table over: release() is called when the last solver and the last handle are gone.
  /// @throws Error(device_error) where a rank does not answer, Error(invalid_input) for a table that is not whole
  explicit Ranks(const espalier_rank_functions& functions, double patience = kPatience);

  [[nodiscard]] int rank() const;  ///< of this process, from 0
  [[nodiscard]] int size() const;  ///< 1 without others
  /// "rank 2 on host node7".
  [[nodiscard]] std::string name_of(int rank) const;
  [[nodiscard]] const std::shared_ptr<ranks::Communicator>& link() const { return link_; }

 private:
  std::shared_ptr<ranks::Communicator> link_;
};

/// Rows [first, first + count).
struct RowRange {
  Index first = 0;
  Index count = 0;
};

/// What one rank has of a matrix of n rows and columns: rows first_row, first_row + 1, ... with the columns of the
/// whole matrix, 0-based, in any order. Rows that several ranks have, and entries that come more than once, are summed
/// in the order of ranks. Of one triangle, an entry of the other one is taken for its mirror image. A rank may have
/// none. Owns nothing.
struct LocalRows {
  Index n = 0;                         ///< of the whole matrix, the same on all ranks
  Index first_row = 0;                 ///< of this rank's rows
  std::span<const Offset> row_ptr;     ///< rows + 1 positions into col and values; row_ptr[0] == 0. Empty: no rows
  std::span<const Index> col;          ///< columns
  std::span<const double> values;      ///< as many, or empty on all ranks: a pattern
  Storage storage = Storage::general;  ///< which entries all ranks together hold, the same on all

  [[nodiscard]] Index rows() const { return row_ptr.empty() ? 0 : static_cast<Index>(row_ptr.size() - 1); }
};

/// The same by entries (row[k], col[k], values[k]) of any rows.
struct LocalEntries {
  Index n = 0;
  std::span<const Index> row;
  std::span<const Index> col;
  std::span<const double> values;
  Storage storage = Storage::general;
};

/// The same of complex matrices, whose storage may be Hermitian as well. The diagonal of a Hermitian one is real; of
/// one triangle, an entry of the other one is taken for its mirror image, the conjugate.
struct ComplexLocalRows {
  Index n = 0;
  Index first_row = 0;
  std::span<const Offset> row_ptr;
  std::span<const Index> col;
  std::span<const std::complex<double>> values;
  Storage storage = Storage::general;

  [[nodiscard]] Index rows() const { return row_ptr.empty() ? 0 : static_cast<Index>(row_ptr.size() - 1); }
};
struct ComplexLocalEntries {
  Index n = 0;
  std::span<const Index> row;
  std::span<const Index> col;
  std::span<const std::complex<double>> values;
  Storage storage = Storage::general;
};

}  // namespace espalier

/// \file
/// The factorized matrix around which changes stand: its entries, and solves with its factor, in the memory where they
/// are fastest.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "device/device_linear_system.hpp"
#include "matrix/row_index.hpp"
#include "solver/session/session.hpp"

namespace espalier::changes {

class Base {
 public:
  /// @param alive  by entity: whether its row and column are in the matrix; for others it has those of the identity,
  ///               scaled
  Base(solver::Session& session, std::vector<char> alive);

  [[nodiscard]] solver::Session& session() const { return *session_; }
  [[nodiscard]] Index order() const { return static_cast<Index>(alive_.size()); }
  [[nodiscard]] bool has(Index entity) const {
    return entity < order() && alive_[static_cast<std::size_t>(entity)] != 0;
  }
  /// Entities whose rows are those of the identity.
  [[nodiscard]] Index dead() const;
  [[nodiscard]] bool symmetric() const { return session_->current().kind() != Kind::lu; }
  [[nodiscard]] const Inertia& inertia() const { return session_->factor->result().inertia; }

  /// Entries as they are stored.
  [[nodiscard]] const solver::StoredMatrix& pattern() const { return session_->current().system->prepared.a; }
  [[nodiscard]] std::span<const double> values() const { return session_->factor->values_of_entries(); }
  /// use(row, value) for the entries of a column; of a row use(column, value).
  template <class Use>
  void for_each_in_column(Index column, Use&& use) const {
    along(column, false, use);
  }
  template <class Use>
  void for_each_in_row(Index row, Use&& use) const {
    along(row, true, use);
  }
  /// The same of the transposed matrix, if `turned`.
  template <class Use>
  void for_each_in_row(Index row, bool turned, Use&& use) const {
    along(row, !turned, use);
  }
  [[nodiscard]] double entry(Index row, Index column) const;
  /// Sums of magnitudes by rows, if `turned` of the transposed matrix; made when first asked for.
  [[nodiscard]] const std::vector<double>& row_sums(bool turned = false);
  /// The rows with the largest sums, from the largest on; some thousands.
  [[nodiscard]] const std::vector<Index>& largest_rows(bool turned);

  /// Where vectors are: on the device of the factor or on the host.
  [[nodiscard]] const device::ResidualSpace& space() const;
  [[nodiscard]] bool on_host() const { return device() == nullptr; }
  /// Vectors of order() numbers there, until this slot is asked for again.
  double* vectors(Index slot, Index columns);
  void send(double* to, const double* from, Index columns) const;
  void fetch(double* to, const double* from, Index columns) const;
  /// x = A^-1 b there, or A^-T b, by the factor alone; x may be b.
  void substitute(const double* b, double* x, Index columns, bool turned = false);

 private:
  [[nodiscard]] device::DeviceLinearSystem* device() const {
    return session_->factor->substitutes() ? nullptr : session_->factor->numeric().device_system();
  }
  template <class Use>
  void along(Index line, bool row, Use& use) const {
    const solver::StoredMatrix& a = pattern();
    const std::span<const double> v = values();
    const auto by_column = [&] {
      for (Offset q = a.col_ptr[line]; q < a.col_ptr[line + 1]; ++q) use(a.row_ind[q], v[static_cast<std::size_t>(q)]);
    };
    if (a.storage == Storage::symmetric_both || (a.storage == Storage::general && !row)) return by_column();
    const matrix::RowIndex& rows = session_->factor->residual().row_index();
    for (Offset q = rows.ptr[static_cast<std::size_t>(line)]; q < rows.ptr[static_cast<std::size_t>(line) + 1]; ++q)
      use(rows.col[q], v[static_cast<std::size_t>(rows.source[q])]);
    if (a.storage != Storage::general) by_column();
  }

  solver::Session* session_;
  std::vector<char> alive_;
  std::vector<double> row_sums_[2];  // of the matrix, of its transpose
  std::vector<Index> largest_rows_[2];
  std::vector<std::vector<double>> slots_;  // on the host
};

}  // namespace espalier::changes

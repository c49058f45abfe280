/// \file
/// The factorized matrix around which changes stand: its entries, and solves with its factor, in the memory where they
/// are fastest.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "base/scalar.hpp"
#include "device/device_linear_system.hpp"
#include "matrix/row_index.hpp"
#include "solver/session/session.hpp"

namespace espalier::changes {

/// T: double or std::complex<double>, as the session has numbers. Vectors of complex numbers are on the host, wherever
/// the factor is: a device has none for these.
template <class T>
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
  /// Then A^T is the conjugate of A.
  [[nodiscard]] bool hermitian() const {
    return symmetric() && session_->current().system->numbers() == base::Numbers::hermitian;
  }
  [[nodiscard]] const Inertia& inertia() const { return session_->factor->result().inertia; }

  /// Entries as they are stored.
  [[nodiscard]] const solver::StoredMatrix& pattern() const { return session_->current().system->prepared.a; }
  [[nodiscard]] std::span<const T> values() const {
    const std::span<const double> v = session_->factor->values_of_entries();
    return {reinterpret_cast<const T*>(v.data()), v.size() / kParts};
  }
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
  [[nodiscard]] T entry(Index row, Index column) const;
  /// Sums of magnitudes by rows, if `turned` of the transposed matrix; made when first asked for.
  [[nodiscard]] const std::vector<double>& row_sums(bool turned = false);
  /// The rows with the largest sums, from the largest on; some thousands.
  [[nodiscard]] const std::vector<Index>& largest_rows(bool turned);

  /// Where vectors are: on the device of the factor or on the host.
  [[nodiscard]] bool on_host() const { return device() == nullptr; }
  /// Vectors of order() numbers there, until this slot is asked for again.
  T* vectors(Index slot, Index columns);
  /// Memory of the caller's own for so many. @throws Error(out_of_memory)
  [[nodiscard]] std::shared_ptr<T[]> memory(Index columns) const;
  void send(T* to, const T* from, Index columns) const;
  void fetch(T* to, const T* from, Index columns) const;
  /// See device::ResidualSpace, for these and the four below.
  void scatter(std::span<const Offset> places, std::span<const T> values, T* y, Index cleared) const;
  void gather(const T* y, std::span<const Offset> places, T* to) const;
  void copy(const T* from, T* to) const;
  void add(const T* from, T* to) const;
  void add_columns(const T* z, std::span<const T> factors, T* y) const;
  /// The largest magnitude in each of some vectors there; NaN where one is.
  [[nodiscard]] std::vector<double> largest(const std::vector<const T*>& vectors) const;
  /// r = b - A x, or b - A^T x, there, each of order() numbers. While it runs, b and x may be others.
  struct Residual {
    T *b, *x, *r;
  };
  /// @returns normwise backward errors
  std::vector<double> residual(const std::vector<Residual>& columns, bool turned) const;
  /// x = A^-1 b there, or A^-T b, by the factor alone; x may be b.
  void substitute(const T* b, T* x, Index columns, bool turned = false);

 private:
  static constexpr std::size_t kParts = base::ScalarTraits<T>::is_complex ? 2 : 1;
  static const double* parts(const T* x) { return reinterpret_cast<const double*>(x); }
  static double* parts(T* x) { return reinterpret_cast<double*>(x); }
  [[nodiscard]] device::DeviceLinearSystem* device() const {
    if (base::ScalarTraits<T>::is_complex || session_->factor->substitutes()) return nullptr;
    return session_->factor->numeric().device_system();
  }
  [[nodiscard]] const device::ResidualSpace& space() const;
  template <class Use>
  void along(Index line, bool row, Use& use) const {
    const solver::StoredMatrix& a = pattern();
    const std::span<const T> v = values();
    const bool conjugates = hermitian();
    const auto entry = [&](Offset q, bool mirrored) {
      const T x = v[static_cast<std::size_t>(q)];
      return conjugates && mirrored ? base::conjugate(x) : x;
    };
    const auto by_column = [&](bool mirrored) {
      for (Offset q = a.col_ptr[line]; q < a.col_ptr[line + 1]; ++q) use(a.row_ind[q], entry(q, mirrored));
    };
    if (a.storage == Storage::symmetric_both || (a.storage == Storage::general && !row)) return by_column(row);
    const matrix::RowIndex& rows = session_->factor->residual().row_index();
    for (Offset q = rows.ptr[static_cast<std::size_t>(line)]; q < rows.ptr[static_cast<std::size_t>(line) + 1]; ++q)
      use(rows.col[q], entry(rows.source[q], !row));
    if (a.storage != Storage::general) by_column(row);
  }

  solver::Session* session_;
  std::vector<char> alive_;
  std::vector<double> row_sums_[2];  // of the matrix, of its transpose
  std::vector<Index> largest_rows_[2];
  std::vector<std::vector<T>> slots_;  // on the host
};

}  // namespace espalier::changes

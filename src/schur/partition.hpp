/// \file
/// A matrix in four parts: the rest, a list of unknowns, and what couples the two.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "espalier/matrix.hpp"
#include "solver/analysis/border.hpp"

namespace espalier::schur {

/// Where the entries of A go. Positions in value arrays are those of A's.
class Partition {
 public:
  /// @param unsymmetric  A_sr and A_rs are kept both, whatever the storage
  /// @throws Error(invalid_input) naming what is wrong with the list
  Partition(const MatrixView& a, std::span<const Index> unknowns, bool unsymmetric);

  [[nodiscard]] Index n() const { return static_cast<Index>(place_.size()); }
  [[nodiscard]] Index size() const { return static_cast<Index>(unknowns_.size()); }
  [[nodiscard]] const std::vector<Index>& unknowns() const { return unknowns_; }
  /// Unknowns of the rest, ascending.
  [[nodiscard]] const std::vector<Index>& rest() const { return rest_; }
  /// The unknowns of `order` that belong to the rest, by their numbers there.
  [[nodiscard]] std::vector<Index> rest_of(std::span<const Index> order) const;

  /// A_rr in the storage of A, without values; and what couples it with the list.
  [[nodiscard]] const SparseMatrix& matrix() const { return matrix_; }
  [[nodiscard]] const std::shared_ptr<const solver::Border>& border() const { return border_; }
  [[nodiscard]] std::vector<double> matrix_values(std::span<const double> values) const {
    return pick(matrix_source_, values);
  }
  [[nodiscard]] std::vector<double> border_values(std::span<const double> values) const {
    return pick(border_source_, values);
  }
  /// s += A_ss, column-major.
  void add_listed(std::span<const double> values, std::span<double> s) const;

  /// y -= A_sr x (of A^T: A_rs^T x), x by the numbers of the rest. @param coupling  border_values()
  void subtract_lower(std::span<const double> coupling, const double* x, double* y, bool transpose) const;
  /// y -= A_rs x (of A^T: A_sr^T x).
  void subtract_upper(std::span<const double> coupling, const double* x, double* y, bool transpose) const;

 private:
  struct Listed {
    Index row, col;
    Offset source;
  };
  [[nodiscard]] static std::vector<double> pick(const std::vector<Offset>& source, std::span<const double> values);
  void take_list(std::span<const Index> unknowns, Index n);
  void split(const MatrixView& a);
  void add_coupling(const MatrixView& a, Index row, Index col, Offset source, solver::Border& border);
  template <class Use>
  void visit_coupling(bool lower, bool transpose, Use&& use) const;

  bool unsymmetric_;
  std::vector<Index> unknowns_, rest_;
  std::vector<Index> place_;  // n; of a listed unknown its place in the list, of others ~ their number in the rest
  SparseMatrix matrix_;
  std::shared_ptr<const solver::Border> border_;
  std::vector<Offset> matrix_source_, border_source_;
  std::vector<Listed> listed_;
};

}  // namespace espalier::schur

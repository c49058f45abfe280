/// \file
/// One front as a dense matrix, eliminated column by column as in the textbooks.
#pragma once

#include <vector>

#include "base/memory.hpp"
#include "device/determinant.hpp"
#include "device/executor.hpp"
#include "espalier/types.hpp"

namespace espalier::device::reference {

/// A square matrix of `rows` rows, column-major, both triangles stored, of which the first `pivots` columns are
/// eliminated. Pivots are chosen among all rows of the pivot block.
template <class T>
class DenseFront {
 public:
  /// Takes memory for a front whose first unknown has this position in the elimination. Values are undefined.
  DenseFront(Index position, Index pivots, Index rows, base::MemoryBudget* budget);

  void clear();
  T& operator()(Index i, Index j) { return values_[static_cast<Offset>(j) * rows_ + i]; }
  const T& operator()(Index i, Index j) const { return values_[static_cast<Offset>(j) * rows_ + i]; }
  [[nodiscard]] Index rows() const { return rows_; }
  [[nodiscard]] Index pivots() const { return pivots_; }

  /// What becomes of the pivots is added to `out` and `determinant`; positions are those of the elimination.
  /// P F P^T = L L^T: the first pivots, in their order; ends at the first that is not positive. @returns whether none
  /// is
  bool llt(const PivotRule& rule, FactorOutcome& out, Determinant& determinant);
  /// P F P^T = L D L^T with 1x1 and 2x2 pivots by complete pivoting (Bunch and Parlett 1971) inside the pivot block.
  void ldlt(const PivotRule& rule, FactorOutcome& out, Determinant& determinant);
  /// P F = L U with row exchanges (partial pivoting) inside the pivot block.
  void lu(const PivotRule& rule, FactorOutcome& out, Determinant& determinant);

  /// Substitution with the eliminated columns: x holds the front's rows. Below the pivots, forward() leaves what is to
  /// be handed on, and backward() reads what is known.
  void forward(Kind kind, bool transpose, std::vector<T>& x) const;
  void backward(Kind kind, bool transpose, std::vector<T>& x) const;

 private:
  void exchange_rows(Index a, Index b);
  void exchange_columns(Index a, Index b);
  void exchange_unknowns(Index a, Index b);
  void eliminate_one(Index j, T d, const PivotRule& rule, FactorOutcome& out);
  void eliminate_two(Index j, const PivotRule& rule, FactorOutcome& out);
  void judge_size(Index unknown, double eigenvalue, const PivotRule& rule, FactorOutcome& out) const;
  void judge_growth(Index j, Index unknown, const PivotRule& rule, FactorOutcome& out) const;
  void divide_by_d(std::vector<T>& x) const;

  Index position_, pivots_, rows_;
  base::Buffer<T> values_;
  std::vector<Index> order_;  // pivots; which row (ldlt: unknown) of the front became the k-th
  std::vector<T> d_, e_;      // ldlt: pivots; diagonal of D, and the entry beside a 2x2 pivot's first
};

}  // namespace espalier::device::reference

/// \file
/// Solving with a matrix that rows and columns in another order make triangular: entry by entry, without a factor.
///
/// Its backward error is that of a few roundings in each row, whatever its condition (Higham, Accuracy and Stability of
/// Numerical Algorithms, section 8.1), and it is regular as long as no pivot is zero, although a singular value may be
/// as small as 2^-n.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "matrix/row_index.hpp"
#include "solver/analysis/prepared_matrix.hpp"

namespace espalier::solver {

class Substitution {
 public:
  /// The substitution of a matrix in general storage; stored zeros do not count. It points to `prepared` and `values`
  /// from then on.
  /// @param rows  of prepared.a
  /// @returns nothing where the matrix is not triangular in any order, or a pivot is not finite
  static std::optional<Substitution> find(const PreparedMatrix& prepared, std::span<const double> values,
                                          const matrix::RowIndex& rows);
  /// op(A) X = B, `columns` of n numbers each, as doubles (base::Numbers); x may alias b.
  void solve(const double* b, double* x, Index columns, bool transpose) const;

 private:
  struct Pivot {
    Index row, col;
    Offset entry;
  };
  Substitution(const PreparedMatrix& prepared, std::span<const double> values)
      : prepared_(&prepared), values_(values) {}
  template <class Value>
  void solve_column(const Value* b, Value* x, bool transpose) const;

  const PreparedMatrix* prepared_;
  std::span<const double> values_;
  std::vector<Pivot> pivots_;  ///< the column of each has entries in the rows of earlier ones and its own alone
};

}  // namespace espalier::solver

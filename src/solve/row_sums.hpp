/// \file
/// One row of a residual for several right-hand sides at a time: a column in every lane of a vector register.
#pragma once

#include <span>

#include "espalier/types.hpp"

namespace espalier::solve {

/// The entries of one row, side by side.
struct RowEntries {
  std::span<const double> values;
  std::span<const Index> cols;
};

/// Sums of one row for `lanes` right-hand sides; the processor chooses the instruction set once.
struct RowSums {
  Index lanes = 0;  ///< 0: this processor has no fused multiply-add in vectors; `sum` is null then
  /// residual[k] = b[k] - sum of a_ij x_j[k] in twice the precision, scale[k] = |b[k]| + sum of |a_ij x_j[k]|.
  /// @param x  n x lanes, row-major
  /// @param b, residual, scale  lanes values each
  void (*sum)(const RowEntries& row, const double* x, const double* b, double* residual, double* scale) = nullptr;
};
const RowSums& row_sums();

}  // namespace espalier::solve

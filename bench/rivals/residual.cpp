#include "rivals/residual.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace espalier::bench {
namespace {

/// Row sums of one column of right-hand sides.
struct Sums {
  explicit Sums(std::size_t n) : residual(n), scale(n), row_norm(n) {}
  std::vector<long double> residual;  ///< b - A x
  std::vector<double> scale;          ///< |A| |x| + |b|
  std::vector<double> row_norm;       ///< sum of |a_ij| over j
  void add(Index row, Index column, double value, const double* x) {
    residual[row] -= static_cast<long double>(value) * x[column];
    scale[row] += std::abs(value * x[column]);
    row_norm[row] += std::abs(value);
  }
};

BackwardError one_column(const MatrixView& a, bool lower_only, const double* x, const double* b) {
  const auto n = static_cast<std::size_t>(a.rows);
  Sums sums(n);
  for (std::size_t i = 0; i < n; ++i) sums.residual[i] = b[i], sums.scale[i] = std::abs(b[i]);
  const bool mirror = lower_only || a.storage == Storage::symmetric_lower || a.storage == Storage::symmetric_upper;
  for (Index column = 0; column < a.cols; ++column) {
    for (Offset k = a.col_ptr[column]; k < a.col_ptr[column + 1]; ++k) {
      const Index row = a.row_ind[k];
      if (lower_only && row < column) continue;
      sums.add(row, column, a.values[k], x);
      if (mirror && row != column) sums.add(column, row, a.values[k], x);
    }
  }
  BackwardError error;
  double worst = 0, norm_a = 0, norm_x = 0, norm_b = 0;
  for (std::size_t i = 0; i < n; ++i) {
    if (!std::isfinite(x[i])) return {std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
    const double residual = std::abs(static_cast<double>(sums.residual[i]));
    worst = std::max(worst, residual);
    norm_a = std::max(norm_a, sums.row_norm[i]);
    norm_x = std::max(norm_x, std::abs(x[i]));
    norm_b = std::max(norm_b, std::abs(b[i]));
    if (residual > 0) error.componentwise = std::max(error.componentwise, residual / sums.scale[i]);
  }
  if (worst > 0) error.normwise = worst / (norm_a * norm_x + norm_b);
  return error;
}

}  // namespace

BackwardError backward_error(const MatrixView& a, bool lower_only, std::span<const double> x, std::span<const double> b,
                             Index columns) {
  BackwardError worst;
  for (Index column = 0; column < columns; ++column) {
    const std::size_t at = static_cast<std::size_t>(column) * static_cast<std::size_t>(a.rows);
    const BackwardError error = one_column(a, lower_only, x.data() + at, b.data() + at);
    worst.normwise = std::max(worst.normwise, error.normwise);
    worst.componentwise = std::max(worst.componentwise, error.componentwise);
  }
  return worst;
}

}  // namespace espalier::bench

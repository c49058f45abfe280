/// \file
/// What a solution of a random sequence of calls is judged by.
#pragma once

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <type_traits>
#include <vector>

#include "espalier/complex_solver.hpp"

namespace espalier::verdict {

inline constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

template <class T>
using MatrixOf = std::conditional_t<std::is_same_v<T, double>, SparseMatrix, ComplexSparseMatrix>;
template <class T>
using ViewOf = std::conditional_t<std::is_same_v<T, double>, MatrixView, ComplexMatrixView>;

inline bool is_hermitian(Storage s) { return s >= Storage::hermitian_lower; }
inline bool one_triangle(Storage s) {
  return s != Storage::general && s != Storage::symmetric_both && s != Storage::hermitian_both;
}

/// |b - op(A) x|_inf / (|op(A)|_inf |x|_inf + |b|_inf), the largest of the columns.
template <class T>
double backward_error(const MatrixOf<T>& a, const std::vector<T>& b, const std::vector<T>& x, Index columns,
                      Transpose how) {
  using Long = std::complex<long double>;
  const auto n = static_cast<std::size_t>(a.rows);
  double worst = 0;
  for (std::size_t c = 0; c < static_cast<std::size_t>(columns); ++c) {
    std::vector<Long> r(n);
    std::vector<double> row(n, 0);
    double largest_x = 0, largest_b = 0;
    for (std::size_t i = 0; i < n; ++i) {
      r[i] = Long(b[c * n + i]);
      largest_b = std::max(largest_b, std::abs(b[c * n + i]));
      if (!std::isfinite(std::abs(x[c * n + i]))) return std::numeric_limits<double>::infinity();
      largest_x = std::max(largest_x, std::abs(x[c * n + i]));
    }
    const auto add = [&](std::size_t i, std::size_t j, std::complex<double> v) {
      if (how != Transpose::no) std::swap(i, j);
      if (how == Transpose::conjugate) v = std::conj(v);
      r[i] -= Long(v) * Long(x[c * n + j]);
      row[i] += std::abs(v);
    };
    for (std::size_t j = 0; j < n; ++j)
      for (auto q = static_cast<std::size_t>(a.col_ptr[j]); q < static_cast<std::size_t>(a.col_ptr[j + 1]); ++q) {
        const auto i = static_cast<std::size_t>(a.row_ind[q]);
        const std::complex<double> v = a.values[q];
        add(i, j, v);
        if (one_triangle(a.storage) && i != j) add(j, i, is_hermitian(a.storage) ? std::conj(v) : v);
      }
    double largest_r = 0, norm = 0;
    for (std::size_t i = 0; i < n; ++i) {
      largest_r = std::max(largest_r, static_cast<double>(std::abs(r[i])));
      norm = std::max(norm, row[i]);
    }
    const double scale = norm * largest_x + largest_b;
    worst = std::max(worst, scale > 0 ? largest_r / scale : 0);
  }
  return worst;
}

}  // namespace espalier::verdict

/// \file
/// Complex systems for the tests of ranks.
#pragma once

#include <cmath>
#include <complex>
#include <random>
#include <vector>

#include "espalier/matrix.hpp"

namespace espalier::ranks {

/// The pattern and real parts of a system of the tests, with imaginary parts of their size.
inline ComplexSparseMatrix complex_of(const SparseMatrix& a, Storage storage) {
  ComplexSparseMatrix c{a.rows, a.cols, a.col_ptr, a.row_ind, {}, storage};
  std::mt19937 random(4);
  std::uniform_real_distribution<double> u(-0.5, 0.5);
  const bool hermitian = storage >= Storage::hermitian_lower;
  for (Index j = 0; j < a.cols; ++j)
    for (auto q = static_cast<std::size_t>(a.col_ptr[j]); q < static_cast<std::size_t>(a.col_ptr[j + 1]); ++q) {
      const double imaginary = u(random) * a.values[q];
      c.values.emplace_back(a.values[q], hermitian && a.row_ind[q] == j ? 0 : imaginary);
    }
  return c;
}

/// What is not known (the phase of a determinant) is the same as itself.
inline bool same_number(std::complex<double> x, std::complex<double> y) {
  return x == y || (std::isnan(x.real()) && std::isnan(y.real()));
}

}  // namespace espalier::ranks

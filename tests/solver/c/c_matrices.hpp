/// \file
/// Matrices as the C interface takes them, from dense ones.
#pragma once

#include <Eigen/Dense>
#include <complex>
#include <cstdint>
#include <random>
#include <type_traits>
#include <vector>

#include "espalier/espalier.h"

namespace espalier::test {

/// One with entries by a rule, of the symmetry of its storage.
inline Eigen::MatrixXcd matrix_for(int storage, int n, bool complex = true) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> u(-1, 1);
  Eigen::MatrixXcd a = Eigen::MatrixXcd::Zero(n, n);
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i)
      if (i == j || (i + 2 * j) % 5 == 0) {
        const double real = u(random);
        a(i, j) = std::complex<double>(real, complex ? u(random) : 0);
      }
  if (storage >= ESPALIER_HERMITIAN_LOWER) return a + a.adjoint();
  return storage == ESPALIER_GENERAL ? a : Eigen::MatrixXcd(a + a.transpose());
}

/// Arrays of indices of 32 or 64 bits, and the structure over them.
template <class Integer>
struct Arrays {
  std::vector<Integer> pointers, indices;
  std::vector<double> values;
  std::conditional_t<std::is_same_v<Integer, std::int64_t>, espalier_matrix_i64, espalier_matrix_i32> c{};

  Arrays(const Eigen::MatrixXcd& a, int layout, int storage, int base, bool complex = true) {
    const auto n = static_cast<int>(a.rows());
    pointers.push_back(base);
    for (int outer = 0; outer < n; ++outer) {
      for (int inner = 0; inner < n; ++inner) {
        const int row = layout == ESPALIER_CSR ? outer : inner, col = layout == ESPALIER_CSR ? inner : outer;
        const bool lower = storage == ESPALIER_SYMMETRIC_LOWER || storage == ESPALIER_HERMITIAN_LOWER;
        const bool upper = storage == ESPALIER_SYMMETRIC_UPPER || storage == ESPALIER_HERMITIAN_UPPER;
        if (a(row, col) == 0.0 || (lower && row < col) || (upper && row > col)) continue;
        indices.push_back(inner + base);
        values.push_back(a(row, col).real());
        if (complex) values.push_back(a(row, col).imag());
      }
      pointers.push_back(static_cast<Integer>(indices.size()) + base);
    }
    c.size = sizeof c;
    c.rows = c.cols = n;
    c.nonzeros = static_cast<std::int64_t>(indices.size());
    c.pointers = pointers.data();
    c.indices = indices.data();
    c.values = values.data();
    c.layout = layout;
    c.storage = storage;
    c.index_base = base;
    c.numbers = complex ? ESPALIER_COMPLEX : ESPALIER_REAL;
  }
};

}  // namespace espalier::test

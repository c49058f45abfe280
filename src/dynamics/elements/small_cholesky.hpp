/// \file
/// Cholesky factorization of the small dense matrices inside elements (enhanced strain parameters).
#pragma once

#include <cmath>

namespace espalier::dynamics {

/// A = L L^T of the symmetric n x n matrix a (row i, column j at a[i * n + j]; the lower triangle is read and
/// overwritten by L). @return false when A is not positive definite
inline bool cholesky_factor(double* a, int n) {
  for (int j = 0; j < n; ++j) {
    double d = a[j * n + j];
    for (int k = 0; k < j; ++k) d -= a[j * n + k] * a[j * n + k];
    if (!(d > 0)) return false;
    d = std::sqrt(d);
    a[j * n + j] = d;
    for (int i = j + 1; i < n; ++i) {
      double s = a[i * n + j];
      for (int k = 0; k < j; ++k) s -= a[i * n + k] * a[j * n + k];
      a[i * n + j] = s / d;
    }
  }
  return true;
}

/// x = A^-1 x with the factor of cholesky_factor.
inline void cholesky_solve(const double* l, int n, double* x) {
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < i; ++k) x[i] -= l[i * n + k] * x[k];
    x[i] /= l[i * n + i];
  }
  for (int i = n - 1; i >= 0; --i) {
    for (int k = i + 1; k < n; ++k) x[i] -= l[k * n + i] * x[k];
    x[i] /= l[i * n + i];
  }
}

}  // namespace espalier::dynamics

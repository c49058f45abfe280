/// \file
/// Dense references and small systems for the tests of the solver's core. Slow and readable on purpose.
#pragma once

#include <cstdint>
#include <vector>

#include "espalier/matrix.hpp"

namespace espalier::reference {

/// The full matrix of any storage, duplicates summed, n x n, column-major.
std::vector<double> dense(const MatrixView& a);
/// Eigenvalues of a symmetric matrix, rising (Eigen, tridiagonal QR).
std::vector<double> eigenvalues(const MatrixView& a);
/// Eigenvalues of the equilibrated matrix by sign; magnitudes up to `tolerance` times the largest count as zero.
struct Signs {
  Index positive = 0, negative = 0, zero = 0;
};
Signs signs(const MatrixView& a, double tolerance);

/// Sign and natural logarithm of the magnitude of det A (Eigen, L U with complete row pivoting).
struct Determinant {
  double sign = 1, log = 0;
};
Determinant determinant(const MatrixView& a);
/// |A|_1 |A^-1|_1 by the explicit inverse.
double condition(const MatrixView& a);
/// op(A)^-1 B by Eigen; n x columns.
std::vector<double> solve(const MatrixView& a, const std::vector<double>& b, Index columns, bool transpose);

/// b - op(A) x in long double, rounded once.
std::vector<double> residual(const MatrixView& a, const double* b, const double* x, bool transpose);
/// The largest of |b - op(A) x|_inf / (|op(A)|_inf |x|_inf + |b|_inf) over the columns; infinity where x is not finite.
double backward_error(const MatrixView& a, const std::vector<double>& b, const std::vector<double>& x,
                      Index columns = 1, bool transpose = false);

/// What the values of a random system are like.
enum class Values {
  positive,    ///< symmetric positive definite (diagonally dominant)
  indefinite,  ///< symmetric, diagonal entries of both signs
  general,     ///< unsymmetric values and pattern, dominated by no diagonal, structurally regular
};
/// A random system of n unknowns, about `per_row` entries a row, in general storage (for `general`) or symmetric_lower.
SparseMatrix random_system(Index n, int per_row, Values values, std::uint64_t seed);
/// [K B^T; B 0] with a positive definite K (n) and a B of `m` rows of three entries each: symmetric_lower, the zero
/// block has no entries. Numbering at random.
SparseMatrix saddle_point(Index n, Index m, std::uint64_t seed);
/// The same symmetric matrix in another storage; `split` writes every third entry as two that sum up to it and mixes
/// the rows within the columns.
SparseMatrix stored_as(const MatrixView& a, Storage storage, bool split = false);

/// n x columns values in [-1, 1).
std::vector<double> random_vector(std::int64_t size, std::uint64_t seed);

/// A matrix from (row, column, value) triples, in the given order within each column.
struct Triple {
  Index row, col;
  double value;
};
SparseMatrix from_triples(Index n, const std::vector<Triple>& triples, Storage storage);

}  // namespace espalier::reference

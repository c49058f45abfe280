/// \file
/// A few long vectors side by side, and the dense arithmetic on them that a search for null vectors needs. The threads
/// share ranges of rows of a fixed length, so that results do not depend on their number.
#pragma once

#include <vector>

#include "base/at.hpp"
#include "base/thread_pool.hpp"
#include "espalier/types.hpp"

namespace espalier::solver {

/// `columns` vectors of `rows` values, column-major.
struct Block {
  Index rows = 0;
  Index columns = 0;
  std::vector<double> values;  ///< rows * columns

  Block(Index the_rows, Index the_columns)
      : rows(the_rows), columns(the_columns), values(at(the_rows) * at(the_columns), 0.0) {}
  [[nodiscard]] double* column(Index c) { return values.data() + Offset{c} * rows; }
  [[nodiscard]] const double* column(Index c) const { return values.data() + Offset{c} * rows; }
};

double dot(base::ThreadPool& pool, const double* x, const double* y, Index n);
/// |x|_2 of numbers whose squares neither overflow nor all vanish.
double norm_two(base::ThreadPool& pool, const double* x, Index n);
/// x /= by
void divide(base::ThreadPool& pool, double* x, double by, Index n);
/// Columns of about 1, by powers of two. @returns false when one is not finite
bool normalize(base::ThreadPool& pool, Block& x);

/// Orthonormal columns that span what those of `x` span (modified Gram and Schmidt, again
/// while more than half of a column goes: Giraud and Langou 2002). A column that depends on the earlier ones becomes a
/// direction of rounding errors, which is as good as a random one, or of sines where these depend on them, too.
void orthonormalize(base::ThreadPool& pool, Block& x);
/// x -= q q^T x.
void project_out(base::ThreadPool& pool, const Block& q, Block& x);

/// Rotates the columns of `y` until they are orthogonal, those of `q` with them (one-sided Jacobi: small singular
/// values are found to high relative accuracy, Demmel and Veselic 1992; of long columns on the triangle of a QR
/// factorization, Drmac and Veselic 2008); then sorts both by the columns of `y`.
/// @returns |y_j|_2, ascending
std::vector<double> rotate_apart(base::ThreadPool& pool, Block& y, Block& q);

/// Eigenvalues of the symmetric part of x^T y, ordered by magnitude (Jacobi).
std::vector<double> ritz_values(base::ThreadPool& pool, const Block& x, const Block& y);

}  // namespace espalier::solver

/// \file
/// The residual in twice the working precision, and backward errors: the judge of every solution. Shares no code with
/// the solver.
#pragma once

#include <span>
#include <vector>

#include "base/thread_pool.hpp"
#include "espalier/matrix.hpp"

namespace espalier::matrix {

/// r = b - op(A) x for `columns` vectors stored one after another. Every component is summed as if in twice the working
/// precision and rounded once (Ogita, Rump, Oishi, "Accurate sum and dot product", SIAM J. Sci. Comput. 26, 2005,
/// Dot2): |error| <= eps |r| + n^2 eps^2 (|A| |x| + |b|). Storage any; duplicates count as their sum.
/// Bit-identical for every number of threads. Memory: up to 8 vectors of 2 numbers per row.
/// @param r may alias b
/// @throws std::invalid_argument when a span has another length than op(A) asks for, or A has no values
void residual(const MatrixView& a, std::span<const double> x, std::span<const double> b, std::span<double> r,
              Index columns = 1, Transpose transpose = Transpose::no, base::ThreadPool* pool = nullptr);

/// How far the system must be changed for x to solve it exactly; the largest over the right-hand sides.
struct BackwardErrors {
  double normwise = 0;       ///< |b - A x|_inf / (|A|_inf |x|_inf + |b|_inf) (Rigal and Gaches)
  double componentwise = 0;  ///< max_i |b - A x|_i / (|A| |x| + |b|)_i (Oettli and Prager); 0/0 counts as 0
  Index worst_row = -1;      ///< the row of the largest componentwise error, -1 when all are 0
};

/// The backward errors of x. Infinite when x or the residual is not finite. Norms of op(A).
/// @throws std::invalid_argument as residual()
BackwardErrors backward_errors(const MatrixView& a, std::span<const double> x, std::span<const double> b,
                               Index columns = 1, Transpose transpose = Transpose::no,
                               base::ThreadPool* pool = nullptr);

}  // namespace espalier::matrix

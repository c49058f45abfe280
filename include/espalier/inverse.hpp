/// \file
/// Entries of the inverse of a factored matrix, where they are needed: variances, gradients of log-determinants.
#pragma once

#include <complex>
#include <limits>
#include <span>

#include "espalier/complex_solver.hpp"
#include "espalier/solver.hpp"

namespace espalier {

/// What a call found out about the entries that it returned.
struct InverseResult {
  Status status;
  double seconds = 0;  ///< whole call
  /// Estimated: the largest error of an entry over the largest entry of its column of A^-1. Columns that are solved for
  /// and refined are compared (`checked`): all where there are no more than eight, else those whose rows of A X = I
  /// look worst (with L L^T those with the largest a_jj x_jj), and some others.
  double error = std::numeric_limits<double>::quiet_NaN();
  /// The same error over the entry itself: entries that are far smaller than the others of their column have fewer
  /// digits.
  double entry_error = std::numeric_limits<double>::quiet_NaN();
  Index checked = 0;  ///< columns compared
  /// Columns that were solved for, since some of their entries lie outside the pattern of the factor.
  Index solved = 0;
};

/// The same with trace(A^-1 B).
template <class Value>
struct TraceResultOf : InverseResult {
  Value trace = 0;
  double trace_error = std::numeric_limits<double>::quiet_NaN();  ///< estimated by `error`, absolute
};
using TraceResult = TraceResultOf<double>;
using ComplexTraceResult = TraceResultOf<std::complex<double>>;

/// Entries of A^-1 for a factor that is there, by Takahashi's recursion over its fronts from the root down. It takes
/// about twice the operations of the factorization, whatever the number of entries on the pattern of the factor, and
/// little memory beside it; only fronts on the way to what is asked for are made. The bits do not depend on the number
/// of threads.
///
/// The pattern of the factor has the entries (j, i) of A^-1 for all entries (i, j) that A stores, zeros as well: those
/// of the gradient d log|det A| / dA = A^-T. Of a symmetric matrix it has the diagonal. Of a general one it has the
/// diagonal where A stores it. Other entries cost a solve for each of their columns.
///
/// A factor of one process, on the host or on one GPU, in core or out of core; those that several GPUs share in core,
/// and those of ranks, are refused with status device_error. Status singular: A has no inverse; the message names a
/// row. accuracy_not_reached: the entries are there, but not three digits of them are sure.
/// @pre solver.state() == factorized, for all below.
/// @throws std::logic_error without a factor, std::invalid_argument for wrong sizes
///
/// x[q] = (A^-1)_ij for the entries q = (i, j) that the pattern stores, in its order; of A^-T or A^-H likewise. Values
/// of the pattern are not read. Of a symmetric matrix give one triangle.
InverseResult selected_inverse(Solver& solver, const MatrixView& pattern, std::span<double> x,
                               Transpose transpose = Transpose::no);
InverseResult selected_inverse(ComplexSolver& solver, const ComplexMatrixView& pattern,
                               std::span<std::complex<double>> x, Transpose transpose = Transpose::no);
/// x[i] = (A^-1)_ii.
InverseResult inverse_diagonal(Solver& solver, std::span<double> x);
InverseResult inverse_diagonal(ComplexSolver& solver, std::span<std::complex<double>> x);
/// Square blocks on the diagonal, `size` unknowns each, which divides n: x holds one after another, each by columns.
InverseResult inverse_blocks(Solver& solver, Index size, std::span<double> x);
InverseResult inverse_blocks(ComplexSolver& solver, Index size, std::span<std::complex<double>> x);
/// trace(A^-1 B), or with B^T or B^H. All of B counts, also where one triangle is stored.
TraceResult trace_of_inverse(Solver& solver, const MatrixView& b, Transpose transpose = Transpose::no);
ComplexTraceResult trace_of_inverse(ComplexSolver& solver, const ComplexMatrixView& b,
                                    Transpose transpose = Transpose::no);

}  // namespace espalier

/// \file
/// A few unknowns of solutions, and right-hand sides with few entries: of the factor only that part is read which leads
/// from the entries to the unknowns.
#pragma once

#include <complex>
#include <span>

#include "espalier/complex_solver.hpp"
#include "espalier/solver.hpp"

namespace espalier {

/// Right-hand sides: column c has values[k] in row row_ind[k] for col_ptr[c] <= k < col_ptr[c + 1] and zeros elsewhere.
/// Rows from 0, in any order; entries of one place are summed. Nothing is kept of the arrays.
template <class Value>
struct SparseColumnsOf {
  std::span<const Offset> col_ptr;  ///< columns + 1, from 0, ascending
  std::span<const Index> row_ind;
  std::span<const Value> values;
};
using SparseColumns = SparseColumnsOf<double>;
using ComplexSparseColumns = SparseColumnsOf<std::complex<double>>;

/// What a call did, and how good the solutions are. Residuals need all of x. So where only a part of the factor was
/// read, the errors are those of a whole solution by the same factor, without refinement, for a random right-hand side:
/// one solve and one residual for each factorization, when the first such call needs them.
struct SolveRowsResult : SolveResult {
  /// The share of the factor's entries that were read, of both sweeps. 1: whole solutions were made and refined, and
  /// the errors are theirs.
  double share = 1;
};

/// The unknowns `rows` of X with op(A) X = B: x has rows.size() numbers for each column of B, one column after another,
/// in the order of `rows`, of which some may be the same.
///
/// Forward substitution passes the fronts from the entries of B to the roots, backward substitution those from the
/// roots to the unknowns (Gilbert and Peierls 1988; for multifrontal factors Amestoy, Duff, Guermouche and Slavova
/// 2010): the numbers are those of a solve without refinement, for any number of threads. Whole solutions are made
/// instead where those would not do: pivots were replaced, the matrix is singular, the componentwise error of the
/// random solution is above 1e-10, or its normwise error above Options::required_backward_error; and where several GPUs
/// have the factor. Of a factor out of core, what is not on a path is not read from its store.
/// @pre solver.state() == factorized; a solver of one process
/// @throws std::logic_error without a factor, or of several ranks; std::invalid_argument for sizes that do not fit.
///         Indices out of range and numbers that are not finite: status invalid_input, which names them
SolveRowsResult solve_rows(Solver& solver, const SparseColumns& b, std::span<const Index> rows, std::span<double> x,
                           Transpose transpose = Transpose::no);
SolveRowsResult solve_rows(ComplexSolver& solver, const ComplexSparseColumns& b, std::span<const Index> rows,
                           std::span<std::complex<double>> x, Transpose transpose = Transpose::no);

}  // namespace espalier

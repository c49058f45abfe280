/// \file
/// Improving a solution with the factor as preconditioner: iterative refinement, and FGMRES or CG where it stalls.
#pragma once

#include <functional>
#include <span>

#include "solve/residual.hpp"

namespace espalier::solve {

/// Y = M X, an approximate inverse of op(A) (the factor's substitution), for `columns` vectors of n values each; Y may
/// equal X.
using Preconditioner = std::function<void(const double* x, double* y, Index columns)>;

struct RefinementOptions {
  int steps = 10;  ///< most steps
  /// Go on with FGMRES (or CG) when refinement is slow: for a factor of lower precision.
  bool krylov = false;
  bool positive_definite = false;  ///< CG instead of FGMRES
  int krylov_steps = 100;          ///< most products in the Krylov phase
  double target = 2e-16;           ///< a componentwise backward error at most this is as good as it gets
  double normwise_target = 0;      ///< and a normwise one at most this, where a step costs more than it gains
};

struct RefinementResult {
  BackwardError error;   ///< of the x returned: the best seen
  int steps = 0;         ///< corrections applied
  int krylov_steps = 0;  ///< products with A in the Krylov phase
};

/// Systems with one matrix, in the memory of a ResidualSpace.
struct Systems {
  const double* b = nullptr;  ///< n x columns, column-major
  double* x = nullptr;        ///< likewise
  Index columns = 1;
  bool transpose = false;
};

/// Fixed-precision refinement with residuals of twice the precision (Wilkinson; Arioli, Demmel and Duff 1989): corrects
/// x until the componentwise backward error no longer halves, nor the normwise one where that is above 1e-14, and keeps
/// the best x. (Zeros in solution and right-hand side keep the componentwise error at 1.)
/// Right-hand sides are refined side by side, at most 32 at a time, each until it stalls. With options.krylov a step
/// that leaves more than a tenth of the error is the last plain one.
/// @param systems  x: on entry the first solutions, on return the best. In the memory of `a`
/// @returns the largest errors and the most steps of any column
RefinementResult refine(const ResidualSpace& a, const Preconditioner& m, const Systems& systems,
                        const RefinementOptions& options);

/// Where a Krylov method ends.
struct KrylovEnd {
  double tolerance;  ///< of the residual, relative to the first one
  int most_steps;
};

/// One of several right-hand sides of a Krylov method.
struct KrylovColumn {
  KrylovEnd end;
  int steps = 0;  ///< result: products with A
};

/// Solves A D = R, D = 0 at the start, column by column: conjugate gradients (positive definite A) or flexible GMRES
/// (Saad 1993). Columns go in lockstep: one call of `m` and one product with A a step for all that are not done, each
/// with scalars of its own. So a column comes to the bits that it has alone, if `m` has columns that do not depend on
/// each other.
/// @param r, d  n x columns, in the memory of `a`, of which slots from kKrylovSlot on are used
void solve_cg(const ResidualSpace& a, const Preconditioner& m, const double* r, double* d,
              std::span<KrylovColumn> columns);
void solve_fgmres(const ResidualSpace& a, const Preconditioner& m, const double* r, double* d, bool transpose,
                  std::span<KrylovColumn> columns);

/// Refinement itself has the slots before.
inline constexpr Index kKrylovSlot = 2;

}  // namespace espalier::solve

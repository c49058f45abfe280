/// \file
/// From a factor to the solution of a system: substitution and refinement, where the factor is.
#pragma once

#include <span>

#include "solver/factor/factor.hpp"

namespace espalier::solver {

/// op(A) X = B for `columns` right-hand sides, n numbers each (base::Numbers).
struct SolveJob {
  const double* b = nullptr;
  double* x = nullptr;  ///< may overlap b
  Index columns = 1;
  bool transpose = false;
};

/// With arrays in the memory of the host. @pre factor.factorized(), here and below
SolveResult solve(Factor& factor, const SolveJob& job, const Context& context);
/// With arrays in the memory of the factor's device, after what is enqueued on a queue of it.
SolveResult solve_device(Factor& factor, const SolveJob& job, void* queue, const Context& context);
/// 1-norm condition number, a lower bound.
double estimate_condition(Factor& factor);

/// A^T of a Hermitian matrix is its conjugate, as is A^H of a symmetric one; A^H x = b of a general one is A^T with the
/// conjugates of both. How a complex system is solved with A or A^T alone:
struct Turned {
  bool transpose = false;  ///< with A^T (lu)
  bool conjugate = false;  ///< for the conjugates of x and b
};
Turned turned(const Analysis& a, Transpose wish);

/// The conjugates of complex numbers.
void conjugate(double* x, Offset count);

}  // namespace espalier::solver

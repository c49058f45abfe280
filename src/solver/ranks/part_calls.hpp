/// \file
/// Calls of Solver and ComplexSolver on a matrix that came in parts: each rank gives and gets its own of values and
/// vectors. Complex numbers are passed as in base::Numbers. Used by the sources of these two alone.
#pragma once

#include <functional>
#include <span>

#include "solver/session/session.hpp"

namespace espalier::solver {

/// The rows of vectors on this rank. @pre s.factor, here and below
RowRange rows_of(const Session& s);
/// See Solver::set_rows(); `call` is the name that the caller knows it by.
void set_rows(Session& s, const char* call, RowRange rows);
/// New values, this rank's in the order of its part. @pre s.parts, here and below
FactorResult refactorize_part(Session& s, std::span<const double> values);
/// The matrix of rank 0. @param checked  its values, on rank 0, which alone looks at it; throws Error for a wrong
/// matrix
FactorResult factorize_of_first(Session& s, const std::function<std::span<const double>()>& checked);
/// Every rank solves the whole system with the others, and keeps its rows.
/// @param whole  solves the system for x, where the right-hand sides are
SolveResult solve_part(Session& s, std::span<const double> b, std::span<double> x, Index columns,
                       const std::function<SolveResult(double* x)>& whole);

/// The same of real numbers with arrays in the memory of this rank's device, after what is enqueued on a queue of it
/// (see Solver::refactorize_device()). Values that are all rank 0's go from device to device; others, and vectors, by
/// way of the host.
FactorResult refactorize_part_device(Session& s, const double* values, Offset count, void* queue);
SolveResult solve_part_device(Session& s, const double* b, double* x, Index columns, void* queue,
                              const std::function<SolveResult(double* x)>& whole);

}  // namespace espalier::solver

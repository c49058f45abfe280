/// \file
/// The one thing that the integrators ask of linear algebra: analyse a pattern once, factorize new values, solve.
#pragma once

#include <memory>
#include <span>

#include "espalier/solver.hpp"

namespace espalier::dynamics {

/// A direct solver for square matrices in CSC form with a fixed pattern.
class LinearSolver {
 public:
  virtual ~LinearSolver() = default;
  /// Symbolic phase; values of `a` may be used for scaling.
  virtual Status analyze(const MatrixView& a) = 0;
  /// Numeric phase; values in the order of the analysed pattern. Status.row names a row of a singular matrix.
  virtual Status factorize(std::span<const double> values) = 0;
  /// Solves for `columns` right sides, stored one after the other; x may alias b.
  virtual Status solve(std::span<const double> b, std::span<double> x, Index columns) = 0;
};

/// Dense LU with partial pivoting: for systems of a few dozen unknowns, where sparse bookkeeping costs more than it
/// saves.
[[nodiscard]] std::unique_ptr<LinearSolver> make_dense_solver();
/// Espalier's own direct solver; every option reaches through.
[[nodiscard]] std::unique_ptr<LinearSolver> make_espalier_solver(Options options = {});
/// Eigen's SparseLU with COLAMD ordering and partial pivoting: the independent second implementation for tests.
[[nodiscard]] std::unique_ptr<LinearSolver> make_eigen_solver();

}  // namespace espalier::dynamics

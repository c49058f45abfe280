/// \file
/// The one thing that the integrators ask of linear algebra: analyse a pattern once, factorize new values, solve.
#pragma once

#include <memory>
#include <span>

#include "espalier/solver.hpp"

namespace espalier::dynamics {

/// What a factorization takes, counted by the analysis; zeros where that is not known.
struct FactorWork {
  double flops = 0;    ///< of a factorization
  Index fronts = 0;    ///< dense matrices that it is made of
  Offset numbers = 0;  ///< of the factor, which a solve reads: L and U, or L twice
};

/// A direct solver for square matrices in CSC form with a fixed pattern.
class LinearSolver {
 public:
  virtual ~LinearSolver() = default;
  /// Symbolic phase; values of `a` may be used for scaling.
  virtual Status analyze(const MatrixView& a) = 0;
  /// analyze() of a pattern that differs here and there from the last one, whose analysis succeeded.
  virtual Status analyze_change(const MatrixView& a) { return analyze(a); }
  /// Numeric phase; values in the order of the analysed pattern. Status.row names a row of a singular matrix.
  virtual Status factorize(std::span<const double> values) = 0;
  /// The GPU whose memory factorize_device() takes values from; -1: none, or nothing was factorized yet.
  [[nodiscard]] virtual int gpu() const { return -1; }
  /// All GPUs that have a part of the factor; see Solver::gpu_places().
  [[nodiscard]] virtual GpuPlaces gpu_places() const { return gpu() < 0 ? GpuPlaces{} : GpuPlaces{{gpu()}, {}}; }
  /// factorize() with `count` values in that memory, when all that was enqueued on `stream` is done.
  virtual Status factorize_device(const double* values, Offset count, void* stream);
  /// solve() in place of `columns` right sides in that memory, likewise. Waits.
  virtual Status solve_device(double* b, Index columns, void* stream);
  /// Sign of the determinant of the matrix last factorized: -1 or 1; 0: not known.
  [[nodiscard]] virtual int determinant_sign() const { return 0; }
  /// What factorize() and solve() take; of a dense solver nothing is told.
  [[nodiscard]] virtual FactorWork work() const { return {}; }
  /// Solves for `columns` right sides, stored one after the other; x may alias b.
  virtual Status solve(std::span<const double> b, std::span<double> x, Index columns) = 0;
};

/// What Espalier's factorizations after this analysis take.
[[nodiscard]] FactorWork work_of(const AnalysisResult& analysis);

/// Dense LU with partial pivoting: for systems of a few dozen unknowns, where sparse bookkeeping costs more than it
/// saves.
[[nodiscard]] std::unique_ptr<LinearSolver> make_dense_solver();
/// Espalier's own direct solver; every option reaches through.
[[nodiscard]] std::unique_ptr<LinearSolver> make_espalier_solver(Options options);
/// Its options for the matrix K of `unknowns` = n + m rows, whose solutions Newton's iteration corrects anyway:
///  - no refinement and no residuals. Chain of 400 bars (4,400 unknowns): 0.70 ms per solve with one step of
///    refinement, 0.34 ms without, 0.18 ms without the residual.
///  - one thread for a tree of small fronts, up to 20,000 unknowns.
///  - a pivot threshold of sqrt(eps) of the factor's precision. Next to a singular position the pivots of the
///    directions that the constraints hardly hold are small and true. A threshold of 0.01 hands all of them up to the
///    root (N-four-bar, N = 400: 7,700 moved columns, 1.0 s instead of 21 ms a factorization, N^3 for large N); with
///    this one they stay in their fronts, and the factor's error, at most eps / sqrt(eps), is gone after a pass.
///  - LU: K may be symmetric by chance at its first values (a mechanism at rest) and is not later (gyroscopic terms,
///    rotations).
[[nodiscard]] Options newton_options(Index unknowns, Precision precision = Precision::fp64);

}  // namespace espalier::dynamics

/// \file
/// L D L^T for optimisers, which read the inertia and probe singular matrices on purpose.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "common/host_pattern.hpp"
#include "common/host_solver.hpp"

namespace espalier::hosts {

/// How pivots are chosen and judged.
struct PivotWish {
  double threshold = 0.01;    ///< entries of L stay below its inverse
  double zero_pivot = 1e-20;  ///< smaller pivots of the scaled matrix are zeros
  bool operator==(const PivotWish&) const = default;
};

/// What a factorization says to an optimiser.
struct Inertia {
  int status = ESPALIER_OK;     ///< espalier_status; the rest counts only with ESPALIER_OK
  std::int64_t rank = 0;        ///< n less the zero pivots
  std::int64_t negative = 0;    ///< eigenvalues
  std::int64_t two_by_two = 0;  ///< pivots
  std::int64_t delayed = 0;     ///< pivots
  bool singular = false;        ///< pivots are zero, or were replaced, so that signs cannot be trusted
};

/// One factor of one pattern. A solution is refined where its backward error asks for it (HostSolver::kPromised); of a
/// singular matrix it stays as the factor gives it: the host knows, and refines by itself.
class InertiaSolver {
 public:
  /// @param interface  as it stands in log lines
  InertiaSolver(std::string interface, std::shared_ptr<const HostPattern> pattern);

  /// @param values  in the host's order
  Inertia factorize(const double* values, const PivotWish& wish);
  /// Solves in place for `columns` right-hand sides, `stride` >= n values from one to the next.
  /// @returns an espalier_status
  int solve(double* x, int columns, int stride);

  /// The options of such factors, for solvers that others make.
  static void prepare(HostSolver& solver);
  static void choose_pivots(HostSolver& solver, const PivotWish& wish);

  /// For the solves to come, for a host that wants it; none by default.
  void set_refinement(int steps) { solver_.set_refinement(steps); }

  [[nodiscard]] const HostSolver& solver() const { return solver_; }
  [[nodiscard]] const HostPattern& pattern() const { return *pattern_; }

 private:
  int analyze(const double* values, const PivotWish& wish);
  int solve_columns(double* x, int columns);

  std::shared_ptr<const HostPattern> pattern_;
  HostSolver solver_;
  PivotWish wish_;
  bool analyzed_ = false, factorized_ = false, singular_ = false;
  std::vector<double> values_;  // where the host's order is not ours
};

}  // namespace espalier::hosts

#include "common/inertia_solver.hpp"

#include <fmt/format.h>

namespace espalier::hosts {

InertiaSolver::InertiaSolver(std::string interface, std::shared_ptr<const HostPattern> pattern)
    : pattern_(std::move(pattern)), solver_(std::move(interface)) {
  prepare(solver_);
}

void InertiaSolver::prepare(HostSolver& solver) {
  solver.insist("kind", "ldlt");
  solver.insist("singular", "report");
  // The values of an interior-point method move over many decades. A matching for each would cost several times what
  // the factorization of a small problem does.
  solver.set_default("rescale", "equilibration");
  solver.set_default("refinement_steps", "0");
  solver.set_default("required_backward_error", "inf");  // HostSolver looks
}

void InertiaSolver::choose_pivots(HostSolver& solver, const PivotWish& wish) {
  solver.set_default("pivot_threshold", fmt::format("{}", wish.threshold));
  solver.set_default("zero_pivot", fmt::format("{}", wish.zero_pivot));
}

// With the values of the first factorization: they say which unknowns pair.
int InertiaSolver::analyze(const double* values, const PivotWish& wish) {
  choose_pivots(solver_, wish);
  const int status = solver_.analyze(pattern_->matrix(values));
  analyzed_ = status == ESPALIER_OK;
  wish_ = wish;
  return status;
}

Inertia InertiaSolver::factorize(const double* given, const PivotWish& wish) {
  factorized_ = false;
  const double* values = pattern_->gather(given, values_);
  Inertia result;
  if (!analyzed_ || !(wish == wish_)) result.status = analyze(values, wish);
  if (result.status == ESPALIER_OK) result.status = solver_.factorize(values, pattern_->entries());
  if (result.status != ESPALIER_OK) return result;
  const espalier_factor_info& f = solver_.factor();
  result.rank = pattern_->n() - f.zero;
  result.negative = f.negative;
  result.two_by_two = f.two_by_two;
  result.delayed = f.delayed;
  result.singular = singular_ = f.zero > 0 || f.perturbed > 0;
  factorized_ = true;
  return result;
}

int InertiaSolver::solve_columns(double* x, int columns) {
  if (singular_) return solver_.substitute(x, x, columns, ESPALIER_NO_TRANSPOSE);
  return solver_.solve(x, x, columns, ESPALIER_NO_TRANSPOSE);
}

int InertiaSolver::solve(double* x, int columns, int stride) {
  if (!factorized_) return ESPALIER_MISUSE;
  if (stride == pattern_->n() || columns == 1) return solve_columns(x, columns);
  for (int k = 0; k < columns; ++k)
    if (const int status = solve_columns(x + static_cast<std::ptrdiff_t>(k) * stride, 1); status != ESPALIER_OK)
      return status;
  return ESPALIER_OK;
}

}  // namespace espalier::hosts

#include "common/inertia_solver.hpp"

#include <fmt/format.h>

namespace espalier::hosts {

InertiaSolver::InertiaSolver(std::string interface, std::shared_ptr<const HostPattern> pattern)
    : pattern_(std::move(pattern)), solver_(std::move(interface)) {
  solver_.insist("kind", "ldlt");
  solver_.insist("singular", "report");
  // The values of an interior-point method move over many decades. A matching for each would cost several times what
  // the factorization of a small problem does.
  solver_.set_default("rescale", "equilibration");
  solver_.set_default("refinement_steps", "0");
  solver_.set_default("required_backward_error", "inf");
}

// With the values of the first factorization: they say which unknowns pair.
int InertiaSolver::analyze(const double* values, const PivotWish& wish) {
  solver_.set_default("pivot_threshold", fmt::format("{}", wish.threshold));
  solver_.set_default("zero_pivot", fmt::format("{}", wish.zero_pivot));
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
  result.singular = f.zero > 0 || f.perturbed > 0;
  factorized_ = true;
  return result;
}

int InertiaSolver::solve(double* x, int columns, int stride) {
  if (!factorized_) return ESPALIER_MISUSE;
  if (stride == pattern_->n() || columns == 1) return solver_.solve(x, x, columns, ESPALIER_NO_TRANSPOSE);
  for (int k = 0; k < columns; ++k) {
    double* column = x + static_cast<std::ptrdiff_t>(k) * stride;
    if (const int status = solver_.solve(column, column, 1, ESPALIER_NO_TRANSPOSE); status != ESPALIER_OK)
      return status;
  }
  return ESPALIER_OK;
}

}  // namespace espalier::hosts

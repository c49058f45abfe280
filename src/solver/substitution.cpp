#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "solve/refinement.hpp"
#include "solver/condition.hpp"
#include "solver/solver_impl.hpp"

namespace espalier {

void Solver::Impl::solve(std::span<const double> b, std::span<double> x, Index columns, bool transpose) {
  const double start = base::now_seconds();
  solution = SolveResult{};
  // b is needed after x has been written.
  std::vector<double> copy;
  if (b.data() < x.data() + x.size() && x.data() < b.data() + b.size()) {
    copy.assign(b.begin(), b.end());
    b = copy;
  }
  numeric->solve(b.data(), x.data(), columns, transpose);
  solution.solve_seconds = base::now_seconds() - start;
  if (options.refinement_steps == 0 && std::isinf(options.required_backward_error)) {  // nobody asks for the residual
    solution.backward_error = solution.componentwise_error = std::numeric_limits<double>::quiet_NaN();
    solution.seconds = solution.solve_seconds;
    return;
  }

  solve::RefinementOptions refinement;
  refinement.steps = options.refinement_steps;
  refinement.krylov = options.precision == Precision::mixed;
  refinement.positive_definite = kind == Kind::llt;
  if (options.precision == Precision::fp32) refinement.steps = 0;
  const solve::Preconditioner apply = [&](const double* from, double* to, Index count) {
    numeric->solve(from, to, count, transpose);
  };
  const solve::RefinementResult r = solve::refine(residual, apply, b.data(), x.data(), columns, transpose, refinement);
  solution.refinement_steps = r.steps + r.krylov_steps;
  solution.backward_error = r.error.normwise;
  solution.componentwise_error = r.error.componentwise;
  solution.seconds = base::now_seconds() - start;
  const double limit = options.precision == Precision::fp32 ? std::max(options.required_backward_error, 1e-5)
                                                            : options.required_backward_error;
  if (!(solution.backward_error <= limit))
    solution.status = {StatusCode::accuracy_not_reached,
                       fmt::format("the backward error is {:.1e} after {} steps of refinement, above the {:.1e} asked "
                                   "for; use precision fp64, "
                                   "matching, or a larger pivot_threshold",
                                   solution.backward_error, solution.refinement_steps, limit),
                       -1};
}

double Solver::Impl::condition_estimate() {
  const double inverse = solver::estimate_inverse_norm(
      plan.tree.n, [&](const double* x, double* y, bool transpose) { numeric->solve(x, y, 1, transpose); });
  return inverse * residual.norm(true);
}

}  // namespace espalier

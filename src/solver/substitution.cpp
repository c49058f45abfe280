#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <vector>

#include "solve/refinement.hpp"
#include "solver/condition.hpp"
#include "solver/solver_impl.hpp"

namespace espalier {

namespace {

// Right-hand sides that are brought to a GPU at a time.
constexpr Index kColumnsOnDevice = 32;

// Waits for a GPU that a failure has left at work on the caller's arrays.
class Settled {
 public:
  explicit Settled(solver::DeviceSystem& system) : system_(system) {}
  Settled(const Settled&) = delete;
  Settled& operator=(const Settled&) = delete;
  ~Settled() { system_.settle(); }

 private:
  solver::DeviceSystem& system_;
};

bool overlap(const double* a, const double* b, std::size_t count) {
  const std::less<> before;
  return before(a, b + count) && before(b, a + count);
}

// What a solution that is not finite comes from: a right-hand side that is not, or numbers near the overflow. `b` may
// be null: it lies on a GPU.
Status not_finite(const double* b, Index rows, Index columns) {
  for (Offset k = 0; b != nullptr && k < Offset{rows} * columns; ++k)
    if (!std::isfinite(b[k]))
      return {StatusCode::invalid_input, fmt::format("row {} of right-hand side {} is {}", k % rows, k / rows, b[k]),
              static_cast<Index>(k % rows)};
  return {StatusCode::accuracy_not_reached,
          "the solution is not finite: it, or what is multiplied on the way, is above the largest number; scale the "
          "right-hand side or the matrix",
          -1};
}

}  // namespace

void Solver::Impl::solve(std::span<const double> b, std::span<double> x, Index columns, bool transpose) {
  const double start = base::now_seconds();
  solution = SolveResult{};
  // b is needed after x has been written.
  std::vector<double> copy;
  if (overlap(b.data(), x.data(), x.size())) {
    copy.assign(b.begin(), b.end());
    b = copy;
  }
  if (!solve_through_device(b.data(), x.data(), columns, transpose)) {
    fetch_values();
    double first = -1;
    const solve::Preconditioner apply = [&](const double* from, double* to, Index count) {
      const double began = base::now_seconds();
      numeric->solve(from, to, count, transpose);
      if (first < 0) first = base::now_seconds() - began;
    };
    solution = SolveResult{};
    solve_at(residual, apply, b.data(), x.data(), columns, transpose, options.precision == Precision::mixed);
    solution.solve_seconds = first;
  }
  judge_solution(b.data(), columns);
  solution.seconds = base::now_seconds() - start;
}

// Substitution and refinement on the GPU. False: there is none, its memory is too small, or only a Krylov method helps.
bool Solver::Impl::solve_through_device(const double* b, double* x, Index columns, bool transpose) {
  solver::DeviceSystem* system = numeric->device_system();
  if (system == nullptr) return false;
  const Settled settled(*system);
  const Offset n = plan.tree.n;
  try {
    for (Index first = 0; first < columns; first += kColumnsOnDevice) {
      const Index now = std::min(kColumnsOnDevice, columns - first);
      double* from = system->right_hand_sides(now);
      double* to = system->solutions(now);
      system->send(from, b + first * n, now * n);
      solve_on_device(*system, from, to, now, transpose);
      system->fetch(x + first * n, to, now * n);
    }
  } catch (const Error& e) {
    if (e.status().code != StatusCode::out_of_memory) throw;
    return false;
  }
  return options.precision != Precision::mixed || solution.backward_error <= options.required_backward_error;
}

void Solver::Impl::solve_device(const double* b, double* x, Index columns, bool transpose, void* stream) {
  const double start = base::now_seconds();
  solution = SolveResult{};
  solver::DeviceSystem* system = numeric->device_system();
  if (system == nullptr)
    throw Error(StatusCode::device_error,
                "the factor is not in the memory of a GPU (" + numeric->device_name() + "); use solve()");
  system->expect_reachable(b, "Solver::solve_device: the right-hand sides");
  system->expect_reachable(x, "Solver::solve_device: the solutions");
  const Settled settled(*system);
  system->wait_for(stream);
  const Offset count = Offset{plan.tree.n} * columns;
  if (overlap(b, x, static_cast<std::size_t>(count))) {
    double* copy = system->right_hand_sides(columns);
    system->copy_vectors(b, copy, count);
    b = copy;
  }
  solve_on_device(*system, b, x, columns, transpose);
  system->finish();
  judge_solution(nullptr, columns);
  solution.seconds = base::now_seconds() - start;
}

void Solver::Impl::solve_on_device(solver::DeviceSystem& system, const double* b, double* x, Index columns,
                                   bool transpose) {
  const double start = base::now_seconds();
  (void)system.take_substitution_seconds();
  const solve::Preconditioner apply = [&](const double* from, double* to, Index count) {
    system.substitute(from, to, count, transpose);
  };
  solve_at(system, apply, b, x, columns, transpose, false);
  double seconds = system.take_substitution_seconds();
  if (seconds < 0) {  // nobody looked at the solution
    system.finish();
    seconds = base::now_seconds() - start;
  }
  solution.solve_seconds += seconds;
}

// First solution and refinement where `space` is; adds to what `solution` says of earlier columns.
void Solver::Impl::solve_at(const solve::ResidualSpace& space, const solve::Preconditioner& apply, const double* b,
                            double* x, Index columns, bool transpose, bool krylov) {
  apply(b, x, columns);
  if (options.refinement_steps == 0 && std::isinf(options.required_backward_error)) {  // nobody asks for the residual
    solution.backward_error = solution.componentwise_error = std::numeric_limits<double>::quiet_NaN();
    return;
  }
  solve::RefinementOptions refinement;
  refinement.steps = options.precision == Precision::fp32 ? 0 : options.refinement_steps;
  refinement.krylov = krylov;
  refinement.positive_definite = kind == Kind::llt;
  const solve::RefinementResult r = solve::refine(space, apply, b, x, columns, transpose, refinement);
  solution.refinement_steps = std::max(solution.refinement_steps, r.steps + r.krylov_steps);
  solution.backward_error = std::max(solution.backward_error, r.error.normwise);
  solution.componentwise_error = std::max(solution.componentwise_error, r.error.componentwise);
}

void Solver::Impl::judge_solution(const double* b, Index columns) {
  const double limit = options.precision == Precision::fp32 ? std::max(options.required_backward_error, 1e-5)
                                                            : options.required_backward_error;
  if (solution.backward_error <= limit || std::isinf(limit)) return;
  if (std::isinf(solution.backward_error)) {
    solution.status = not_finite(b, plan.tree.n, columns);
    return;
  }
  solution.status = {StatusCode::accuracy_not_reached,
                     fmt::format("the backward error is {:.1e} after {} steps of refinement, above the {:.1e} asked "
                                 "for; use precision fp64, "
                                 "matching, or a larger pivot_threshold",
                                 solution.backward_error, solution.refinement_steps, limit),
                     -1};
}

double Solver::Impl::condition_estimate() {
  fetch_values();
  const double inverse = solver::estimate_inverse_norm(
      plan.tree.n, [&](const double* x, double* y, bool transpose) { numeric->solve(x, y, 1, transpose); });
  return inverse * residual.norm(true);
}

}  // namespace espalier

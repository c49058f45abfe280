#include "solver/solution/solution.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <functional>
#include <limits>
#include <vector>

#include "base/stage.hpp"
#include "solve/refinement.hpp"
#include "solver/solution/condition.hpp"

namespace espalier::solver {

namespace {

// Right-hand sides that are brought to a device at a time.
constexpr Index kColumnsOnDevice = 32;

// Whether solutions stay as the substitution gives them.
bool nobody_looks(const Options& options) {
  return options.refinement_steps == 0 && std::isinf(options.required_backward_error);
}

bool overlap(const double* a, const double* b, std::size_t count) {
  const std::less<> before;
  return before(a, b + count) && before(b, a + count);
}

// What a solution that is not finite comes from: a right-hand side that is not, or numbers near the overflow. `b` may
// be null: it lies on a device.
// @param parts  doubles in a number
Status not_finite(const double* b, Index rows, Index columns, Index parts) {
  for (Offset k = 0; b != nullptr && k < Offset{rows} * columns * parts; ++k)
    if (!std::isfinite(b[k])) {
      const Offset row = k / parts % rows;
      return {
          StatusCode::invalid_input,
          fmt::format("row {} of right-hand side {} is {}{}", row, k / parts / rows, b[k], k % parts == 1 ? "i" : ""),
          static_cast<Index>(row)};
    }
  return {StatusCode::accuracy_not_reached,
          "the solution is not finite: it, or what is multiplied on the way, is above the largest number; scale the "
          "right-hand side or the matrix",
          -1};
}

class Solving {
 public:
  Solving(Factor& factor, const Context& context)
      : factor_(factor),
        options_(context.options),
        link_(context.link),
        n_(factor.analysis()->n()),
        doubles_(factor.analysis()->doubles()) {}

  void on_host(const SolveJob& job) {
    const std::shared_ptr<const solve::ResidualSpace> residual = factor_.residual_space();
    double first = -1;
    const solve::Preconditioner apply = [&](const double* from, double* to, Index count) {
      const double began = base::now_seconds();
      factor_.solve(from, to, count, job.transpose);
      if (first < 0) first = base::now_seconds() - began;
    };
    result_ = SolveResult{};
    refine(*residual, apply, job);
    result_.solve_seconds = first;
  }

  // False: no device holds the linear system, or its memory is too small.
  bool through_device(const SolveJob& job) {
    device::DeviceLinearSystem* device = factor_.numeric().device_system();
    if (device == nullptr) return false;
    const device::Settled settled(*device);
    const Offset n = doubles_;
    try {
      take_vectors(*device, std::min(kColumnsOnDevice, job.columns));
    } catch (const Error& e) {
      if (e.status().code != StatusCode::out_of_memory) throw;
      return false;
    }
    try {
      base::Stage stage("solve", job.columns, "columns");
      for (Index first = 0; first < job.columns; first += kColumnsOnDevice) {
        const Index now = std::min(kColumnsOnDevice, job.columns - first);
        double* from = device->right_hand_sides(now);
        double* to = device->solutions(now);
        device->send(from, job.b + first * n, now * n);
        on_device(*device, {from, to, now, job.transpose});
        device->fetch(job.x + first * n, to, now * n);
        stage.reach(first + now);
      }
    } catch (const Error& e) {
      // Other ranks are in the middle of it.
      if (e.status().code != StatusCode::out_of_memory || link_ != nullptr) throw;
      return false;
    }
    return true;
  }

  void on_device(device::DeviceLinearSystem& device, const SolveJob& job) {
    const double start = base::now_seconds();
    (void)device.take_substitution_seconds();
    const solve::Preconditioner apply = [&](const double* from, double* to, Index count) {
      device.substitute(from, to, count, job.transpose);
    };
    refine(device, apply, job);
    double seconds = device.take_substitution_seconds();
    if (seconds < 0) {  // nobody looked at the solution
      device.finish();
      seconds = base::now_seconds() - start;
    }
    result_.solve_seconds += seconds;
  }

  SolveResult judged(const double* b, Index columns, double start) {
    judge(b, columns);
    result_.seconds = base::now_seconds() - start;
    return std::move(result_);
  }

 private:
  // First solution and refinement where `space` is; adds to what the result says of earlier columns.
  void refine(const solve::ResidualSpace& space, const solve::Preconditioner& apply, const SolveJob& job) {
    {
      const base::Stage stage("substitution", job.columns, "columns");
      apply(job.b, job.x, job.columns);
    }
    if (nobody_looks(options_)) {
      result_.backward_error = result_.componentwise_error = std::numeric_limits<double>::quiet_NaN();
      return;
    }
    const base::Stage stage("refinement");
    solve::RefinementOptions refinement;
    refinement.steps = factor_.precision() == Precision::fp32 ? 0 : options_.refinement_steps;
    refinement.target = options_.refinement_target;
    // A step reads all of a factor out of core twice more. Unless the caller has set a target of his own, what an FP64
    // factor alone gives is good enough there if it has lost nothing but roundings. An FP32 one is always refined.
    constexpr double kRoundings = 1e-14;
    const bool out_of_core = factor_.numeric().out_of_core().budget_bytes > 0;
    if (out_of_core && factor_.precision() == Precision::fp64 &&
        options_.refinement_target == Options{}.refinement_target && refinement.steps > 0)
      refinement.normwise_target = kRoundings;
    refinement.krylov = factor_.precision() == Precision::mixed;
    refinement.positive_definite = factor_.analysis()->kind() == Kind::llt;
    const solve::RefinementResult r =
        solve::refine(space, apply, {job.b, job.x, job.columns, job.transpose}, refinement);
    result_.refinement_steps = std::max(result_.refinement_steps, r.steps + r.krylov_steps);
    result_.backward_error = std::max(result_.backward_error, r.error.normwise);
    result_.componentwise_error = std::max(result_.componentwise_error, r.error.componentwise);
  }

  // What one rank lacks, all do without.
  void take_vectors(device::DeviceLinearSystem& device, Index columns) {
    const auto take = [&] {
      (void)device.right_hand_sides(columns);
      (void)device.solutions(columns);
    };
    if (link_ != nullptr)
      link_->expect_all(take);
    else
      take();
  }

  // `b` may be null: it lies on a device.
  void judge(const double* b, Index columns) {
    const double asked = options_.required_backward_error;
    const double limit = factor_.precision() == Precision::fp32 ? std::max(asked, 1e-5) : asked;
    if (result_.backward_error <= limit || std::isinf(limit)) return;
    if (std::isinf(result_.backward_error)) {
      result_.status = not_finite(b, n_, columns, factor_.analysis()->system->parts());
      return;
    }
    result_.status = {StatusCode::accuracy_not_reached,
                      fmt::format("the backward error is {:.1e} after {} steps of refinement, above the {:.1e} asked "
                                  "for; use precision fp64, matching, or a larger pivot_threshold",
                                  result_.backward_error, result_.refinement_steps, limit),
                      -1};
  }

  Factor& factor_;
  const Options& options_;
  ranks::Communicator* link_;  // null: there are no other ranks
  Index n_;
  Offset doubles_;  // of a vector
  SolveResult result_;
};

// A solution that is noise in the null space is as large as that makes it, and so is what a backward error allows it.
Status lost_in_null_space(Factor& factor, const SolveJob& job) {
  constexpr double kLost = 1e-2;  // an ill-conditioned regular part leaves less
  const auto n = static_cast<std::size_t>(factor.analysis()->doubles());
  if (factor.result().rank < 0 || factor.result().rank == factor.analysis()->n()) return {};
  const auto largest = [](std::span<const double> v) {
    double most = 0;
    for (const double x : v) most = std::max(most, std::abs(x));
    return most;
  };
  std::vector<double> rest(n);
  for (std::size_t c = 0; c < at(job.columns); ++c) {
    const double* b = job.b + c * n;
    solve::ResidualColumn column{b, job.x + c * n, rest.data(), {}};
    factor.residual_space()->compute(std::span(&column, 1), job.transpose);
    if (const double left = largest(rest), given = largest({b, n}); left > kLost * given)
      return {StatusCode::accuracy_not_reached,
              fmt::format("the matrix is singular, and the solution is lost in its null space: {:.1e} of the "
                          "right-hand side of {:.1e} is left; fix or remove the dependent rows",
                          left, given),
              -1};
  }
  return {};
}

}  // namespace

SolveResult solve(Factor& factor, const SolveJob& asked, const Context& context) {
  const double start = base::now_seconds();
  SolveJob job = asked;
  const auto size = static_cast<std::size_t>(factor.analysis()->doubles()) * at(job.columns);
  // b is needed after x has been written where somebody looks at x, takes another factor, or a device gives up.
  const bool in_place = job.b == job.x && nobody_looks(context.options) &&
                        context.options.precision == Precision::fp64 && factor.numeric().device_system() == nullptr;
  std::vector<double> copy;
  if (!in_place && overlap(job.b, job.x, size)) {
    copy.assign(job.b, job.b + size);
    job.b = copy.data();
  }
  const auto once = [&] {
    Solving solving(factor, context);
    if (factor.substitutes() || !solving.through_device(job)) solving.on_host(job);
    return solving.judged(job.b, job.columns, start);
  };
  SolveResult result = once();
  factor.note(result);
  if (factor.goes_to_fp64()) result = once();
  const bool inaccurate = result.status.code == StatusCode::accuracy_not_reached;
  if (inaccurate && factor.goes_to_substitution()) result = once();
  if (std::isnan(result.backward_error)) return result;  // nobody asks
  if (result.status.ok() && !std::isinf(context.options.required_backward_error))
    result.status = lost_in_null_space(factor, job);
  if (Status status = factor.second_look(job.b, job.x, job.transpose); !status.ok()) result.status = std::move(status);
  return result;
}

SolveResult solve_device(Factor& factor, const SolveJob& asked, void* queue, const Context& context) {
  const double start = base::now_seconds();
  SolveJob job = asked;
  device::DeviceLinearSystem* device = factor.numeric().device_system();
  if (device == nullptr) throw not_on_device(factor.numeric(), "solve()");
  device->expect_reachable(job.b, "Solver::solve_device: the right-hand sides");
  device->expect_reachable(job.x, "Solver::solve_device: the solutions");
  const device::Settled settled(*device);
  device->wait_for(queue);
  const Offset count = Offset{factor.analysis()->n()} * job.columns;
  if (overlap(job.b, job.x, at(count))) {
    double* copy = device->right_hand_sides(job.columns);
    device->copy_vectors(job.b, copy, count);
    job.b = copy;
  }
  Solving solving(factor, context);
  solving.on_device(*device, job);
  device->finish();
  SolveResult result = solving.judged(nullptr, job.columns, start);
  factor.note(result);
  return result;
}

double estimate_condition(Factor& factor) {
  const double norm = factor.norm(true);
  const Index n = factor.analysis()->n();
  const auto solve_real = [&](const double* x, double* y, Index columns, bool transpose) {
    factor.solve(x, y, columns, transpose);
  };
  if (factor.analysis()->system->numbers() == base::Numbers::real)
    return estimate_inverse_norm<double>(n, solve_real) * norm;
  const bool hermitian = factor.analysis()->system->numbers() == base::Numbers::hermitian;
  const double inverse = estimate_inverse_norm<std::complex<double>>(
      n, [&](const std::complex<double>* x, std::complex<double>* y, Index columns, bool adjoint) {
        const Offset numbers = Offset{n} * columns;
        std::vector<std::complex<double>> from(x, x + numbers);
        const bool turned = adjoint && !hermitian;  // A^-H x is the conjugate of A^-T times that of x
        if (turned) conjugate(reinterpret_cast<double*>(from.data()), numbers);
        solve_real(reinterpret_cast<const double*>(from.data()), reinterpret_cast<double*>(y), columns, adjoint);
        if (turned) conjugate(reinterpret_cast<double*>(y), numbers);
      });
  return inverse * norm;
}

Turned turned(const Analysis& a, Transpose wish) {
  if (wish == Transpose::no) return {};
  if (a.kind() == Kind::lu) return {true, wish == Transpose::conjugate};
  const bool hermitian = a.system->numbers() == base::Numbers::hermitian;
  return {false, (wish == Transpose::yes) == hermitian};
}

void conjugate(double* x, Offset count) {
  for (Offset k = 0; k < count; ++k) x[2 * k + 1] = -x[2 * k + 1];
}

}  // namespace espalier::solver

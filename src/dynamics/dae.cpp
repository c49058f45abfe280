// The public generic layer: failures become a Status.
#include "espalier/dae.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "dynamics/constraints/redundancy.hpp"
#include "dynamics/dae/check.hpp"
#include "dynamics/dae/function_system.hpp"
#include "dynamics/guarded.hpp"
#include "dynamics/integrators/bdf.hpp"
#include "dynamics/integrators/generalized_alpha.hpp"
#include "dynamics/integrators/initial.hpp"

namespace espalier {

using namespace dynamics;

double& MatrixEntries::operator()(Index row, Index col) {
  if (row < 0 || row >= rows_ || col < 0 || col >= cols_)
    throw std::logic_error(fmt::format("entry ({}, {}) lies outside of a {} x {} matrix", row, col, rows_, cols_));
  const Index line = by_columns_ ? col : row, other = by_columns_ ? row : col;
  if (ptr_ == nullptr) return data_[static_cast<Offset>(line) * (by_columns_ ? rows_ : cols_) + other];
  const Index *first = ind_ + ptr_[line], *last = ind_ + ptr_[line + 1];
  const Index* found = std::lower_bound(first, last, other);
  if (found == last || *found != other)
    throw std::logic_error(fmt::format("entry ({}, {}) was not declared in the pattern of its matrix", row, col));
  return data_[found - ind_];
}

double JacobianCheck::largest() const { return std::max({f_a, f_v, f_q, phi_q, nu, gamma, f_lambda, chart}); }

namespace {

BdfOptions bdf_options(const DaeOptions& o) {
  BdfOptions b;
  b.max_order = o.max_order;
  b.relative = o.relative;
  b.absolute = o.absolute;
  b.absolute_velocity = o.absolute_velocity;
  b.test_velocity = o.test_velocity;
  b.initial_step = o.initial_step;
  b.max_step = o.max_step;
  b.min_step = o.min_step;
  b.fixed_step = o.step;
  b.fixed_order = o.order;
  b.constraint_tolerance = o.constraint_tolerance;
  if (o.max_newton > 0) b.max_newton = o.max_newton;
  b.newton_tolerance = o.newton_tolerance;
  b.refactor_rate = o.refactor_rate;
  b.refactor_step = o.refactor_step;
  b.iteration = o.iteration;
  return b;
}

AlphaOptions alpha_options(const DaeOptions& o) {
  if (!(o.step > 0)) throw std::invalid_argument("generalized_alpha needs DaeOptions::step > 0");
  AlphaOptions a;
  a.step = o.step;
  a.spectral_radius = o.spectral_radius;
  if (o.hht_alpha) a.hht_alpha = *o.hht_alpha;
  a.newton_tolerance = o.newton_tolerance;
  a.tolerance = o.newton_change;
  a.constraint_tolerance = o.constraint_tolerance;
  if (o.max_newton > 0) a.max_newton = o.max_newton;
  a.refactor_rate = o.refactor_rate;
  return a;
}

/// @throws std::invalid_argument naming the field
DaeOptions checked(DaeOptions o) {
  const auto require = [](bool good, const char* what) {
    if (!good) throw std::invalid_argument(std::string("DaeOptions::") + what);
  };
  require(o.method == DaeMethod::bdf || o.method == DaeMethod::generalized_alpha, "method is none of DaeMethod");
  require(o.iteration >= DaeIteration::reduced && o.iteration <= DaeIteration::full_boolean,
          "iteration is none of DaeIteration");
  require(o.step >= 0 && std::isfinite(o.step), "step must be 0 (variable) or a length of time");
  require(o.order >= 0 && o.order <= kMaxBdfOrder, "order must be 0 (variable) or 1 to 5");
  require(o.initial_step >= 0 && std::isfinite(o.initial_step), "initial_step must be 0 (found) or a length of time");
  require(o.max_step > 0, "max_step must be above 0");
  require(o.min_step >= 0 && o.min_step <= o.max_step, "min_step must lie between 0 and max_step");
  require(o.spectral_radius >= 0 && o.spectral_radius <= 1, "spectral_radius must lie in [0, 1]");
  require(!o.hht_alpha || (*o.hht_alpha >= -1.0 / 3 && *o.hht_alpha <= 0), "hht_alpha must lie in [-1/3, 0]");
  require(o.newton_change > 0, "newton_change must be above 0");
  require(o.newton_tolerance > 0, "newton_tolerance must be above 0");
  require(o.refactor_rate >= 0, "refactor_rate must not be negative");
  require(o.refactor_step >= 0, "refactor_step must not be negative");
  require(o.constraint_tolerance > 0, "constraint_tolerance must be above 0");
  require(o.max_newton >= 0, "max_newton must be 0 (12 or 15) or at least 1");
  require(o.allowed_position >= 0, "allowed_position must not be negative");
  require(o.allowed_velocity >= 0, "allowed_velocity must not be negative");
  return o;
}

std::vector<double> copy(std::span<const double> x) { return {x.begin(), x.end()}; }

}  // namespace

struct Dae::Impl {
  Impl(DaeFunctions functions, DaeOptions given)
      : options(checked(std::move(given))),
        system(std::move(functions)),
        equations(system, options.solver ? make_espalier_solver(*options.solver) : nullptr),
        guard(equations) {
    make_integrator();
  }

  void make_integrator() {
    if (options.method == DaeMethod::bdf)
      integrator = std::make_unique<BdfIntegrator>(equations, bdf_options(options));
    else
      integrator = std::make_unique<GeneralizedAlpha>(equations, alpha_options(options));
  }

  void begin(double t, std::span<const double> q, std::span<const double> v) {
    const auto n = at(system.sizes().velocity);
    if (q.size() != n || v.size() != n)
      throw std::invalid_argument(
          fmt::format("start: {} coordinates need as many q and v, got {} and {}", n, q.size(), v.size()));
    if (!std::isfinite(t)) throw std::invalid_argument(fmt::format("start: t is {}", t));
    for (std::size_t i = 0; i < n; ++i)
      if (!std::isfinite(q[i]) || !std::isfinite(v[i]))
        throw std::invalid_argument(fmt::format("start: q[{}] is {}, v[{}] is {}", i, q[i], i, v[i]));
    started = false;
    State state(system.sizes());
    state.t = t;
    state.q = copy(q);
    state.v = copy(v);
    ConsistencyOptions consistency;
    consistency.allowed_position = options.allowed_position;
    consistency.allowed_velocity = options.allowed_velocity;
    guard.prepare(state, consistency);
    make_integrator();
    integrator->start(state);
    started = true;
  }

  void run(double t_end, const std::function<bool(const DaeStep&)>& observe) {
    constexpr long kWatchEvery = 100;  // steps between looks at the constraints left out
    if (!(t_end >= integrator->state().t))
      throw std::invalid_argument(fmt::format("integrate: the system is at t = {:g}, the end {:g} lies before it",
                                              integrator->state().t, t_end));
    integrator->integrate(t_end, [&](const StepReport& r) {
      if (r.index % kWatchEvery == 0) guard.check(integrator->state());
      return !observe ||
             observe({r.index, r.t, r.h, r.order, r.newton_iterations, r.factorizations, r.error, r.rounding});
    });
    guard.check(integrator->state());
  }

  void need_start() const {
    if (!started) throw std::logic_error("start() was not called, or failed");
  }

  DaeOptions options;
  FunctionSystem system;
  Equations equations;
  RedundancyGuard guard;
  std::unique_ptr<Integrator> integrator;
  bool started = false;
};

Dae::Dae(DaeFunctions functions, DaeOptions options)
    : impl_(std::make_unique<Impl>(std::move(functions), std::move(options))) {}
Dae::~Dae() = default;
Dae::Dae(Dae&&) noexcept = default;
Dae& Dae::operator=(Dae&&) noexcept = default;

Status Dae::start(double t, std::span<const double> q, std::span<const double> v) {
  return guarded([&] { impl_->begin(t, q, v); }, "system");
}

Status Dae::integrate(double t_end, const std::function<bool(const DaeStep&)>& observe) {
  impl_->need_start();
  return guarded([&] { impl_->run(t_end, observe); }, "system");
}

StateView Dae::state() const {
  impl_->need_start();
  return impl_->integrator->state().view();
}

Energy Dae::energy() const { return impl_->system.energy(state()); }

JacobianCheck Dae::check_jacobians() const { return check_jacobians(state()); }

JacobianCheck Dae::check_jacobians(const StateView& s) const {
  State own(impl_->system.sizes());
  const auto take = [](std::span<const double> from, std::vector<double>& to, const char* name) {
    if (from.empty() && !to.empty()) return;  // zero
    if (from.size() != to.size())
      throw std::invalid_argument(
          fmt::format("check_jacobians: {} has {} numbers, {} are needed", name, from.size(), to.size()));
    to = copy(from);
  };
  own.t = s.t;
  take(s.q, own.q, "q");
  take(s.v, own.v, "v");
  take(s.a, own.a, "a");
  take(s.lambda, own.lambda, "lambda");
  return dynamics::check_jacobians(impl_->system, own);
}

DaeSummary Dae::summary() const {
  const IntegratorCounts& c = impl_->integrator->counts();
  const EquationCounts& e = impl_->equations.counts();
  DaeSummary s;
  s.steps = c.steps;
  s.newton_iterations = c.newton_iterations;
  s.error_failures = c.error_failures;
  s.newton_failures = c.newton_failures;
  s.residuals = e.residuals;
  s.tangents = e.tangents;
  s.analyses = e.analyses;
  s.factorizations = e.factorizations;
  s.solves = e.solves;
  s.assembly_seconds = e.assembly_seconds;
  s.analysis_seconds = e.analysis_seconds;
  s.factorization_seconds = e.factor_seconds;
  s.solve_seconds = e.solve_seconds;
  s.largest_position = c.largest_position;
  s.largest_velocity = c.largest_velocity;
  s.largest_acceleration = c.largest_acceleration;
  s.rounded = c.rounded;
  s.largest_rounding = c.largest_rounding;
  s.divisions = c.divisions;
  s.degrees_of_freedom = impl_->started ? impl_->guard.degrees_of_freedom() : 0;
  if (impl_->started) s.redundant = impl_->guard.notices();
  return s;
}

}  // namespace espalier

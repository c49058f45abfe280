#include "dynamics/integrators/generalized_alpha.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "dynamics/integrators/newton_limits.hpp"

namespace espalier::dynamics {

namespace {
// Steps that begin with a new factor after one in which Newton failed with an old one: what turns or bends that fast
// will do so in the next steps too (rotor at 900 rad/s: each failure costs three passes).
constexpr int kFreshSteps = 10;
// A step in which Newton fails with a new factor is halved, down to a thousandth. After kShortSteps shorter steps the
// double length is tried again, and after twice as many for every halving there was, up to 64 times.
constexpr int kMostHalvings = 10;
constexpr int kShortSteps = 20;
constexpr long kMostDoublings = 6;
// Above this radius what an iteration has left in v' and lambda hardly fades, and swings: the second differences by
// which the method knows its own error are full of it, the iteration then may leave more, and so on (double pendulum,
// radius 0.99, 3,200 steps: a joint's force ten times too large). Its share of that error falls with (1 - radius)^2.
constexpr double kFades = 0.9, kLeastShare = 1e-4;
}  // namespace

GeneralizedAlpha::GeneralizedAlpha(Equations& equations, const AlphaOptions& options)
    : equations_(equations), options_(options), vectors_(equations) {
  if (!(options.step > 0)) throw std::invalid_argument("the step size must be positive");
  double radius = options.spectral_radius;
  if (options.hht_alpha <= 0) {
    if (options.hht_alpha < -1.0 / 3) throw std::invalid_argument("hht_alpha must lie in [-1/3, 0]");
    alpha_m_ = 0;
    alpha_f_ = -options.hht_alpha;
    radius = (1 - alpha_f_) / (1 + alpha_f_);
  } else {
    if (!(radius >= 0 && radius <= 1)) throw std::invalid_argument("spectral_radius must lie in [0, 1]");
    alpha_m_ = (2 * radius - 1) / (radius + 1);
    alpha_f_ = radius / (radius + 1);
  }
  const double fading = (1 - radius) / (1 - kFades);
  newton_share_ = options.newton_tolerance * std::clamp(fading * fading, kLeastShare, 1.0);
  gamma_ = 0.5 - alpha_m_ + alpha_f_;
  beta_ = 0.25 * (gamma_ + 0.5) * (gamma_ + 0.5);
  const auto n = at(equations.sizes().velocity);
  const auto m = at(equations.sizes().constraints);
  for (auto* x : {&a_old_, &a_base_, &v_base_, &delta_base_, &delta_, &weight_, &f_, &work_, &jerk_, &a_from_, &v_from_,
                  &a_step_, &force_})
    x->assign(n, 0.0);
  rhs_.assign(n + m, 0.0);
  second_.assign(n + m, 0.0);
}

void GeneralizedAlpha::start(const State& state) {
  vectors_.leave();
  state_ = trial_ = state;
  a_old_ = state.a;
  equations_.system().accept(state.view());
  factor_c_q_ = 0;
  fresh_left_ = 0;
  search_ = false;
  halvings_ = steps_at_length_ = 0;
  drifted_ = h_before_ = fitted_ = local_error_ = floor_ = force_floor_ = 0;
  jerk_known_ = plain_start_ = rate_measured_ = false;
  trend_ = 1;
  a_before_ = state.a;
  lambda_before_ = state.lambda;
}

// With a' the true and a the algorithmic acceleration at the end: a = a_base + (1 - alpha_f)/(1 - alpha_m) a'.
void GeneralizedAlpha::coefficients(double h) {
  h_ = h;
  fit(h);
  const double slope = (1 - alpha_f_) / (1 - alpha_m_);
  c_v_ = h * gamma_ * slope;
  c_q_ = h * h * beta_ * slope;
  run(StepBases{alpha_m_, alpha_f_, beta_, gamma_, h});
}

void GeneralizedAlpha::factorize(long& reason) {
  ++reason;
  const StateView bodies = on_device() ? vectors_.state(trial_) : StateView{};
  equations_.factorize(trial_.view(), {1, c_v_, c_q_}, on_device() ? &bodies : nullptr);
  factor_c_q_ = c_q_;
  rate_poor_ = false;
  fresh_ = true;
  rate_ = 0.5;
  factor_life_.begin();
  passes_of_factor_ = 0;
  const KktSolver& k = equations_.kkt();
  const MatrixView matrix = k.matrix();
  factor_cost_ = passes_of_factor(
      {k.work(), matrix.rows, k.w_pattern().nonzeros(), static_cast<Offset>(matrix.row_ind.size()), k.gpu() >= 0});
}

// After a step.
bool GeneralizedAlpha::wants_new_factor() {
  const bool pays = factor_life_.spent_by(passes_of_factor_, factor_cost_);
  return options_.refactor_rate ? rate_ > *options_.refactor_rate : pays;
}

// What is left up to t_limit is taken in one step of at most 1.01 times the length, or in two equal ones: a last step
// that is very short would carry rounding over h^2 into accelerations and multipliers.
double GeneralizedAlpha::next_length(double t_limit) const {
  const double step = std::ldexp(options_.step, -halvings_), left = t_limit - state_.t;
  return left < 1.01 * step ? left : left < 2 * step * (1 - 1e-9) ? left / 2 : step;
}

// Newton from the predicted state. With `renew`, or where the old factor is known to be poor, it begins with a new
// factor. Where a GPU has lost factor or vectors, the host begins anew: it has all but the trial state.
// @return whether it converged
bool GeneralizedAlpha::attempt(double h, bool renew, StepReport& report) {
  try {
    choose_place(h);
    const bool converged = attempt_here(h, renew, report);
    if (converged && on_device()) end_step_there();
    return converged;
  } catch (const Error& error) {
    if (!vectors_.host_can_continue(error)) throw;
    vectors_.give_up(error);
  }
  factor_c_q_ = 0;
  return attempt_here(h, renew, report);
}

bool GeneralizedAlpha::attempt_here(double h, bool renew, StepReport& report) {
  coefficients(h);
  predict();
  fresh_ = began_fresh_ = false;
  passes_of_factor_ = 0;
  failure_ = {};
  try {
    constraints_of_trial();
    begin_factor(renew);
    Outcome outcome = solve(report);
    for (int round = 0; outcome == Outcome::converged && equations_.system().augment(trial_.view()); ++round)
      outcome = round < kMostAugmentations ? solve(report) : Outcome::slow;
    return outcome == Outcome::converged;
  } catch (const Error& error) {  // a trial state beyond what angles, elements or pivots allow
    const StatusCode code = error.status().code;
    if (code == StatusCode::out_of_memory || code == StatusCode::device_error || code == StatusCode::cancelled) throw;
    failure_ = error.status();
    factor_c_q_ = 0;
    began_fresh_ = fresh_ = true;
    return false;
  }
}

void GeneralizedAlpha::begin_factor(bool renew) {
  if (factor_c_q_ == 0) {
    factorize(counts_.refactor_first);
  } else if (std::abs(c_q_ / factor_c_q_ - 1) > 0.2) {
    factorize(counts_.refactor_step);
  } else if (renew) {
    factorize(counts_.refactor_failed);
  } else if (rate_poor_ || fresh_left_ > 0) {
    factorize(counts_.refactor_rate);
  }
  if (!renew && fresh_left_ == 0) search_ = false;
  fresh_left_ = std::max(fresh_left_ - 1, 0);
  began_fresh_ = fresh_;
}

// After a failed attempt: a new factor, and a search where it is chosen; if there were both, half the step.
void GeneralizedAlpha::give_way() {
  if (!began_fresh_) fresh_left_ = kFreshSteps;
  const bool searched = !options_.search || std::exchange(search_, true);
  if (!began_fresh_ || (!searched && failure_.ok())) return;
  if (halvings_ == kMostHalvings) {
    if (!failure_.ok()) throw Error(failure_);
    throw Error(StatusCode::accuracy_not_reached,
                fmt::format("Newton did not converge at t = {:.9g} with steps of {:g}, down to {:.3g}; take a smaller "
                            "step",
                            trial_.t, options_.step, h_));
  }
  ++halvings_;
  steps_at_length_ = 0;
  const double length = std::ldexp(options_.step, -halvings_);
  if (counts_.divisions++ == 0) {
    counts_.first_division = state_.t;
    counts_.shortest_step = length;
  }
  counts_.shortest_step = std::min(counts_.shortest_step, length);
}

StepReport GeneralizedAlpha::step(double t_limit) {
  if (state_.v.size() != delta_.size()) throw std::logic_error("start() was not called");
  if (t_limit <= state_.t) throw std::invalid_argument("t_limit lies before the present time");
  StepReport report;
  report.order = 2;
  if (sliver(t_limit)) {
    report.h = t_limit - state_.t;
    drift(t_limit);
    report.t = state_.t;
    count(report);
    report.index = counts_.steps;
    return report;
  }
  const long factorizations = equations_.counts().factorizations;
  if (equations_.update_pattern()) factor_c_q_ = 0;
  for (bool renew = false; !attempt(next_length(t_limit), renew, report) || !settle(report); renew = true) {
    ++report.newton_failures;
    give_way();
  }
  accept();
  report.t = state_.t;
  report.h = h_;
  report.levels.motion = report.residual;
  report.factorizations = static_cast<int>(equations_.counts().factorizations - factorizations);
  count(report);
  report.index = counts_.steps;
  return report;
}

void GeneralizedAlpha::accept() {
  const double slope = (1 - alpha_f_) / (1 - alpha_m_);
  for_coordinates([&](std::size_t i) { a_old_[i] = a_base_[i] + slope * a_step_[i]; });
  if (!on_device()) learn_trend();
  learn_jerk();
  copy(equations_.pool(), state_.a, a_before_);
  carry({a_old_, jerk_, a_before_});
  lambda_before_ = state_.lambda;
  h_before_ = fitted_ = h_;
  drifted_ = 0;
  std::swap(state_, trial_);
  equations_.system().accept(state_.view());
  if (halvings_ > 0 && ++steps_at_length_ >= kShortSteps << std::min(counts_.divisions - 1, kMostDoublings)) {
    --halvings_;
    steps_at_length_ = 0;
  }
}

}  // namespace espalier::dynamics

#include "dynamics/integrators/generalized_alpha.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace espalier::dynamics {

namespace {
// With a new factor a slower rate asks for a better one within the step: the predictor stretches what turns, so that W
// at its state lacks the right geometric stiffness; after two passes the state is good enough for a better W.
constexpr double kSlow = 0.25;
// Steps that begin with a new factor after one in which Newton failed with an old one: what turns or bends that fast
// will do so in the next steps too (rotor at 900 rad/s: each failure costs three passes).
constexpr int kFreshSteps = 10;
// A step in which Newton fails with a new factor is halved, down to a thousandth. After kShortSteps shorter steps the
// double length is tried again, and after twice as many for every halving there was, up to 64 times: each change of the
// length excites the accelerations of the constraints (rotor at 1,000 rad/s: 4e2 to 3e5 m/s^2, gone after 20 steps).
constexpr int kMostHalvings = 10;
constexpr int kShortSteps = 20;
constexpr long kMostDoublings = 6;
}  // namespace

GeneralizedAlpha::GeneralizedAlpha(Equations& equations, const AlphaOptions& options)
    : equations_(equations), options_(options) {
  if (!(options.step > 0)) throw std::invalid_argument("the step size must be positive");
  if (options.hht_alpha <= 0) {
    if (options.hht_alpha < -1.0 / 3) throw std::invalid_argument("hht_alpha must lie in [-1/3, 0]");
    alpha_m_ = 0;
    alpha_f_ = -options.hht_alpha;
  } else {
    const double rho = options.spectral_radius;
    if (!(rho >= 0 && rho <= 1)) throw std::invalid_argument("spectral_radius must lie in [0, 1]");
    alpha_m_ = (2 * rho - 1) / (rho + 1);
    alpha_f_ = rho / (rho + 1);
  }
  gamma_ = 0.5 - alpha_m_ + alpha_f_;
  beta_ = 0.25 * (gamma_ + 0.5) * (gamma_ + 0.5);
  const auto n = static_cast<std::size_t>(equations.sizes().velocity);
  const auto m = static_cast<std::size_t>(equations.sizes().constraints);
  for (auto* x : {&a_old_, &a_base_, &v_base_, &delta_base_, &delta_, &weight_, &f_, &change_}) x->assign(n, 0.0);
  rhs_.assign(n + m, 0.0);
}

void GeneralizedAlpha::start(const State& state) {
  state_ = trial_ = state;
  a_old_ = state.a;
  equations_.system().accept(state.view());
  factor_c_q_ = 0;
  fresh_left_ = 0;
  halvings_ = steps_at_length_ = 0;
  h_before_ = 0;
  trend_ = 1;
  a_before_ = state.a;
  lambda_before_ = state.lambda;
}

// With a' the true and a the algorithmic acceleration at the end: a = a_base + (1 - alpha_f)/(1 - alpha_m) a'.
void GeneralizedAlpha::coefficients(double h) {
  h_ = h;
  const double slope = (1 - alpha_f_) / (1 - alpha_m_);
  c_v_ = h * gamma_ * slope;
  c_q_ = h * h * beta_ * slope;
  for (std::size_t i = 0; i < a_old_.size(); ++i) {
    a_base_[i] = (alpha_f_ * state_.a[i] - alpha_m_ * a_old_[i]) / (1 - alpha_m_);
    v_base_[i] = state_.v[i] + h * ((1 - gamma_) * a_old_[i] + gamma_ * a_base_[i]);
    delta_base_[i] = h * state_.v[i] + h * h * ((0.5 - beta_) * a_old_[i] + beta_ * a_base_[i]);
  }
}

void GeneralizedAlpha::predict() {
  trial_.t = state_.t + h_;
  // On the line through the last two points, as far as that served in the step before. Chain of 400 bars, constraints
  // to 1e-12: 2.9 passes of Newton a step where the last values alone need 4.1.
  const double ahead = h_before_ > 0 ? trend_ * h_ / h_before_ : 0;
  for (std::size_t i = 0; i < trial_.lambda.size(); ++i) {
    trial_.lambda[i] = state_.lambda[i] + ahead * (state_.lambda[i] - lambda_before_[i]);
  }
  for (std::size_t i = 0; i < delta_.size(); ++i) {
    trial_.a[i] = state_.a[i] + ahead * (state_.a[i] - a_before_[i]);
    trial_.v[i] = v_base_[i] + c_v_ * trial_.a[i];
    delta_[i] = delta_base_[i] + c_q_ * trial_.a[i];
  }
  equations_.system().retract(state_.q, delta_, trial_.q);
  equations_.system().magnitude(state_.q, weight_);
  for (double& w : weight_) w = 1 / (options_.tolerance * (options_.relative * w + options_.absolute));
}

// The multiple of the last change that would have predicted this step best (least squares, weighted), in [0, 1]: near 1
// in smooth motion, 0 where the accelerations of stiff modes change their sign from step to step, which a whole change
// would triple (wheelset: two passes of Newton a step instead of three).
void GeneralizedAlpha::learn_trend() {
  double along = 0, square = 0;
  for (std::size_t i = 0; i < a_before_.size(); ++i) {
    const double w = weight_[i] * weight_[i], last = state_.a[i] - a_before_[i];
    along += w * last * (trial_.a[i] - state_.a[i]);
    square += w * last * last;
  }
  trend_ = square > 0 && h_before_ > 0 ? std::clamp(along * h_before_ / (square * h_), 0.0, 1.0) : 1.0;
}

void GeneralizedAlpha::factorize(long& reason) {
  ++reason;
  equations_.factorize(trial_.view(), {1, c_v_, c_q_});
  factor_c_q_ = c_q_;
  rate_poor_ = false;
  fresh_ = true;
  rate_ = 0.5;
}

// K [da; dlambda] = [-F; -Phi / c_q]; returns the weighted change of q. @pre constraints are evaluated at the trial
// state
double GeneralizedAlpha::iterate(StepReport& report) {
  const std::size_t n = delta_.size(), m = trial_.lambda.size();
  equations_.motion(trial_.view(), f_);
  report.residual = max_norm(f_);
  for (std::size_t i = 0; i < n; ++i) rhs_[i] = -f_[i];
  const ConstSpan phi = equations_.phi();
  for (std::size_t i = 0; i < m; ++i) rhs_[n + i] = -phi[i] / c_q_;
  equations_.solve(rhs_);
  double sum = 0;
  // K takes the change of q at the trial state; that of delta, and so of a, is T(delta)^-1 times it.
  const Span da(rhs_.data(), n);
  equations_.system().rate_of_velocity(delta_, da, da);
  for (std::size_t i = 0; i < n; ++i) {
    trial_.a[i] += da[i];
    trial_.v[i] += c_v_ * da[i];
    delta_[i] += c_q_ * da[i];
    const double change = std::max(c_q_, h_ * c_v_) * std::abs(da[i]) * weight_[i];
    sum += change * change;
  }
  for (std::size_t i = 0; i < m; ++i) trial_.lambda[i] += rhs_[n + i];
  equations_.system().retract(state_.q, delta_, trial_.q);
  equations_.evaluate_constraints(trial_.t, trial_.q, {});
  return n == 0 ? 0.0 : std::sqrt(sum / static_cast<double>(n));
}

GeneralizedAlpha::Outcome GeneralizedAlpha::solve(StepReport& report) {
  double previous = 0, first = 0;
  int renewed = 0;
  report.newton_rate = 0;
  for (int iteration = 1; iteration <= options_.max_newton; ++iteration) {
    const double change = iterate(report);
    report.newton_iterations = iteration;
    if (!std::isfinite(change)) return Outcome::diverged;
    if (iteration == 1) first = change;
    if (iteration > 1 && previous > 0) {
      report.newton_rate = change / previous;
      rate_ = std::max(0.3 * rate_, report.newton_rate);
    }
    report.levels.position = max_norm(equations_.phi());
    const double rate = std::min(rate_, 0.9);
    if ((change * rate / (1 - rate) <= 1 || change == 0) && report.levels.position <= options_.constraint_tolerance) {
      rate_poor_ = report.newton_rate > options_.refactor_rate;
      return Outcome::converged;
    }
    if (change < 1e-4 && report.newton_rate > 0.5) return Outcome::converged;  // round-off
    if (iteration > 2 && report.newton_rate > 2 && change > first) return Outcome::diverged;
    // Even the passes that are left will not do at this rate, but a new factor will.
    if (!fresh_ && iteration > 2 && change * std::pow(report.newton_rate, options_.max_newton - iteration) > 1)
      return Outcome::slow;
    if (fresh_ && iteration >= renewed + 2 && report.newton_rate > std::max(kSlow, options_.refactor_rate)) {
      renewed = iteration;
      factorize(counts_.refactor_rate);
    }
    previous = change;
  }
  return Outcome::slow;
}

// Newton from the predicted state. With `renew`, or where the old factor is known to be poor, it begins with a new
// factor. @return whether it converged
bool GeneralizedAlpha::attempt(double t_limit, bool renew, StepReport& report) {
  const double step = std::ldexp(options_.step, -halvings_), left = t_limit - state_.t;
  coefficients(left < 1.01 * step ? left : step);
  predict();
  fresh_ = began_fresh_ = false;
  failure_ = {};
  try {
    equations_.evaluate_constraints(trial_.t, trial_.q, {});
    begin_factor(renew);
    return solve(report) == Outcome::converged;
  } catch (const Error& error) {  // a trial state beyond what angles, elements or pivots allow
    const StatusCode code = error.status().code;
    if (code == StatusCode::out_of_memory || code == StatusCode::device_error) throw;
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
  fresh_left_ = std::max(fresh_left_ - 1, 0);
  began_fresh_ = fresh_;
}

// After a failed attempt: a new factor, and if there was one, half the step.
void GeneralizedAlpha::give_way() {
  if (!began_fresh_) {
    fresh_left_ = kFreshSteps;
    return;
  }
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
  const long factorizations = equations_.counts().factorizations;
  if (equations_.update_pattern()) factor_c_q_ = 0;
  for (bool renew = false; !attempt(t_limit, renew, report); renew = true) {
    ++report.newton_failures;
    give_way();
  }
  accept();
  report.t = state_.t;
  report.h = h_;
  report.order = 2;
  report.levels.motion = report.residual;
  report.factorizations = static_cast<int>(equations_.counts().factorizations - factorizations);
  count(report);
  report.index = counts_.steps;
  return report;
}

void GeneralizedAlpha::accept() {
  const double slope = (1 - alpha_f_) / (1 - alpha_m_);
  for (std::size_t i = 0; i < a_old_.size(); ++i) a_old_[i] = a_base_[i] + slope * trial_.a[i];
  learn_trend();
  a_before_ = state_.a;
  lambda_before_ = state_.lambda;
  h_before_ = h_;
  std::swap(state_, trial_);
  equations_.system().accept(state_.view());
  if (halvings_ > 0 && ++steps_at_length_ >= kShortSteps << std::min(counts_.divisions - 1, kMostDoublings)) {
    --halvings_;
    steps_at_length_ = 0;
  }
}

}  // namespace espalier::dynamics

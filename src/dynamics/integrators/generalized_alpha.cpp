#include "dynamics/integrators/generalized_alpha.hpp"

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
  h_before_ = 0;
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
  // On the line through the last two points. Chain of 400 bars, constraints to 1e-12: 2.9 passes of Newton a step where
  // the last values alone need 4.1.
  const double ahead = h_before_ > 0 ? h_ / h_before_ : 0;
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
  for (std::size_t i = 0; i < n; ++i) {
    const double da = rhs_[i];
    trial_.a[i] += da;
    trial_.v[i] += c_v_ * da;
    delta_[i] += c_q_ * da;
    const double change = std::max(c_q_ * std::abs(da), h_ * c_v_ * std::abs(da)) * weight_[i];
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
    if (fresh_ && iteration >= renewed + 2 && report.newton_rate > std::max(kSlow, options_.refactor_rate)) {
      renewed = iteration;
      factorize(counts_.refactor_rate);
    }
    previous = change;
  }
  return Outcome::slow;
}

StepReport GeneralizedAlpha::step(double t_limit) {
  if (state_.v.size() != delta_.size()) throw std::logic_error("start() was not called");
  if (t_limit <= state_.t) throw std::invalid_argument("t_limit lies before the present time");
  StepReport report;
  const long factorizations = equations_.counts().factorizations;
  const double left = t_limit - state_.t;
  coefficients(left < 1.01 * options_.step ? left : options_.step);
  predict();
  equations_.evaluate_constraints(trial_.t, trial_.q, {});
  const bool pattern_changed = equations_.update_pattern();
  fresh_ = false;
  if (factor_c_q_ == 0 || pattern_changed) {
    factorize(counts_.refactor_first);
  } else if (std::abs(c_q_ / factor_c_q_ - 1) > 0.2) {
    factorize(counts_.refactor_step);
  } else if (rate_poor_ || fresh_left_ > 0) {
    factorize(counts_.refactor_rate);
  }
  fresh_left_ = std::max(fresh_left_ - 1, 0);
  if (solve(report) != Outcome::converged) {
    ++report.newton_failures;
    fresh_left_ = kFreshSteps;
    predict();
    equations_.evaluate_constraints(trial_.t, trial_.q, {});
    factorize(counts_.refactor_failed);
    if (solve(report) != Outcome::converged) {
      throw Error(StatusCode::accuracy_not_reached, "Newton did not converge at t = " + std::to_string(trial_.t) +
                                                        " with step " + std::to_string(h_) + "; take a smaller step");
    }
  }
  const double slope = (1 - alpha_f_) / (1 - alpha_m_);
  for (std::size_t i = 0; i < a_old_.size(); ++i) a_old_[i] = a_base_[i] + slope * trial_.a[i];
  a_before_ = state_.a;
  lambda_before_ = state_.lambda;
  h_before_ = h_;
  std::swap(state_, trial_);
  equations_.system().accept(state_.view());
  report.t = state_.t;
  report.h = h_;
  report.order = 2;
  report.levels.motion = report.residual;
  report.factorizations = static_cast<int>(equations_.counts().factorizations - factorizations);
  count(report);
  report.index = counts_.steps;
  return report;
}

}  // namespace espalier::dynamics

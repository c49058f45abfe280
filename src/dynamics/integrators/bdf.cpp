#include "dynamics/integrators/bdf.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include "dynamics/constraints/redundancy.hpp"

namespace espalier::dynamics {

namespace {
// A step below this fraction of the recent ones is a collapse.
constexpr double kCollapse = 0.1;
}  // namespace

BdfIntegrator::BdfIntegrator(Equations& equations, const BdfOptions& options)
    : equations_(equations), options_(options), history_(equations.system()) {
  if (options.max_order < 1 || options.max_order > kMaxBdfOrder)
    throw std::invalid_argument("max_order must be 1 to 5");
  if (options.fixed_order < 0 || options.fixed_order > kMaxBdfOrder) {
    throw std::invalid_argument("fixed_order must be 0 to 5");
  }
  if (!(options.relative >= 0) || !(options.absolute > 0)) throw std::invalid_argument("tolerances must be positive");
  if (options_.absolute_velocity <= 0) options_.absolute_velocity = options_.absolute;
  newton_limit_ = options_.max_newton;
  allocate();
}

void BdfIntegrator::allocate() {
  const auto n = static_cast<std::size_t>(equations_.sizes().velocity);
  const auto m = static_cast<std::size_t>(equations_.sizes().constraints);
  state_ = trial_ = State(equations_.sizes());
  for (auto* x : {&theta_, &theta_hat_, &v_hat_, &theta_pred_, &v_pred_, &weight_q_, &weight_v_, &r1_, &r2_, &dq_, &dv_,
                  &f_, &work_n_}) {
    x->assign(n, 0.0);
  }
  level_.assign(m, 0.0);
  rhs_.assign(2 * (n + m), 0.0);
}

void BdfIntegrator::start(const State& state) {
  state_ = state;
  trial_ = state;
  history_.clear();
  order_ = 1;
  steps_at_order_ = 0;
  factor_hp_ = 0;
  h_ = options_.fixed_step > 0 ? options_.fixed_step : first_step();
  h_calm_ = 0;
  // The formula of order 1 wants one past point more for its predictor; a point on the parabola through the state at
  // t - h serves: it differs from the true past by O(h^3) in q and O(h^2) in v.
  const std::size_t n = state.v.size();
  for (std::size_t i = 0; i < n; ++i) {
    dq_[i] = h_ * (-state.v[i] + 0.5 * h_ * state.a[i]);
    dv_[i] = state.v[i] - h_ * state.a[i];
  }
  std::vector<double> q_past(state.q.size());
  equations_.system().retract(state.q, dq_, q_past);
  equations_.system().accept(state.view());
  history_.push(state.t - h_, q_past, dv_, state.lambda);
  history_.push(state.t, state.q, state.v, state.lambda);
}

void BdfIntegrator::start(const std::vector<State>& past) {
  if (past.empty()) throw std::invalid_argument("no past points");
  start(past.back());
  history_.clear();
  for (const State& s : past) history_.push(s.t, s.q, s.v, s.lambda);
  order_ = std::clamp(static_cast<int>(past.size()) - 1, 1, kMaxBdfOrder);
  if (options_.fixed_order > 0) order_ = std::min(order_, options_.fixed_order);
}

double BdfIntegrator::first_step() const {
  if (options_.initial_step > 0) return options_.initial_step;
  // Order 1: the local error h^2 |q''| / 2 shall be a hundredth of the tolerance. v'' is unknown at the start; |a| over
  // a millisecond stands in for it. The error test repairs a guess that was too large.
  double acceleration_q = 0, acceleration_v = 0;
  std::vector<double> size(state_.v.size());
  equations_.system().magnitude(state_.q, size);
  for (std::size_t i = 0; i < size.size(); ++i) {
    const double a = std::abs(state_.a[i]);
    acceleration_q = std::max(acceleration_q, a / (options_.relative * size[i] + options_.absolute));
    acceleration_v =
        std::max(acceleration_v, a / (options_.relative * std::abs(state_.v[i]) + options_.absolute_velocity));
  }
  double h = std::min(options_.max_step, 1e-3);
  if (acceleration_q > 0) h = std::min(h, std::sqrt(0.02 / acceleration_q));
  if (acceleration_v > 0 && options_.test_velocity) h = std::min(h, std::sqrt(0.02 * 1e-3 / acceleration_v));
  return h;
}

void BdfIntegrator::set_formula(double h, int order) {
  formula_.order = order;
  formula_.h = h;
  formula_.t = state_.t + h;
  std::array<double, kMaxBdfOrder + 1> w{};
  derivative_weights(formula_.t, history_.times(order), w);
  formula_.hp = 1 / w[0];
  std::fill(theta_hat_.begin(), theta_hat_.end(), 0.0);
  std::fill(v_hat_.begin(), v_hat_.end(), 0.0);
  for (int j = 0; j < order; ++j) {
    const double factor = -formula_.hp * w[static_cast<std::size_t>(j) + 1];
    const ConstSpan theta = history_.theta(j), v = history_.v(j);
    for (std::size_t i = 0; i < theta.size(); ++i) {
      theta_hat_[i] += factor * theta[i];
      v_hat_[i] += factor * v[i];
    }
  }
}

void BdfIntegrator::predict() {
  std::array<double, kMaxBdfOrder + 2> w{};
  const int points = std::min(formula_.order + 1, history_.size());
  value_weights(formula_.t, history_.times(points), w);
  std::fill(theta_pred_.begin(), theta_pred_.end(), 0.0);
  std::fill(v_pred_.begin(), v_pred_.end(), 0.0);
  for (int j = 0; j < points; ++j) {
    const double factor = w[static_cast<std::size_t>(j)];
    const ConstSpan theta = history_.theta(j), v = history_.v(j);
    for (std::size_t i = 0; i < theta.size(); ++i) {
      theta_pred_[i] += factor * theta[i];
      v_pred_[i] += factor * v[i];
    }
  }
  const int lambda_points = std::min(points, 3);
  value_weights(formula_.t, history_.times(lambda_points), w);
  std::fill(trial_.lambda.begin(), trial_.lambda.end(), 0.0);
  for (int j = 0; j < lambda_points; ++j) {
    const ConstSpan lambda = history_.lambda(j);
    for (std::size_t i = 0; i < lambda.size(); ++i) trial_.lambda[i] += w[static_cast<std::size_t>(j)] * lambda[i];
  }
  trial_.t = formula_.t;
  theta_ = theta_pred_;
  trial_.v = v_pred_;
  for (std::size_t i = 0; i < theta_.size(); ++i) trial_.a[i] = (v_pred_[i] - v_hat_[i]) / formula_.hp;
  equations_.system().retract(history_.q(0), theta_pred_, trial_.q);
}

void BdfIntegrator::error_weights() {
  equations_.system().magnitude(state_.q, weight_q_);
  for (std::size_t i = 0; i < weight_q_.size(); ++i) {
    weight_q_[i] = 1 / (options_.relative * weight_q_[i] + options_.absolute);
    weight_v_[i] = 1 / (options_.relative * std::abs(state_.v[i]) + options_.absolute_velocity);
  }
}

double BdfIntegrator::norm(ConstSpan x, ConstSpan weight) const {
  double sum = 0;
  for (std::size_t i = 0; i < x.size(); ++i) sum += x[i] * x[i] * weight[i] * weight[i];
  return x.empty() ? 0.0 : std::sqrt(sum / static_cast<double>(x.size()));
}

void BdfIntegrator::ensure_factor(bool retry) {
  const bool step_left = factor_hp_ > 0 && std::abs(formula_.hp / factor_hp_ - 1) > options_.refactor_step;
  const bool pattern_changed = equations_.update_pattern();
  if (factor_hp_ > 0 && !retry && !step_left && !rate_poor_ && !pattern_changed) {
    factor_fresh_ = false;
    return;
  }
  ++(factor_hp_ == 0 || pattern_changed ? counts_.refactor_first
     : retry                            ? counts_.refactor_failed
     : step_left                        ? counts_.refactor_step
                                        : counts_.refactor_rate);
  equations_.evaluate_constraints(trial_.t, trial_.q, {});
  equations_.factorize(trial_.view(), {1, formula_.hp, formula_.hp * formula_.hp});
  factor_hp_ = formula_.hp;
  factor_fresh_ = true;
  rate_poor_ = false;
  rate_ = 0.5;
}

// R1 = v - T(theta) (theta - theta^)/h' and R2 = a - (v - v^)/h'; theta_ must belong to s.
void BdfIntegrator::stage_residuals(const State& s) {
  const double inverse = 1 / formula_.hp;
  for (std::size_t i = 0; i < theta_.size(); ++i) {
    r1_[i] = (theta_[i] - theta_hat_[i]) * inverse;
    r2_[i] = s.a[i] - (s.v[i] - v_hat_[i]) * inverse;
  }
  equations_.system().velocity_of_rate(theta_, r1_, r1_);
  for (std::size_t i = 0; i < theta_.size(); ++i) r1_[i] = s.v[i] - r1_[i];
}

// One pass of the reduced iteration; returns the weighted size of the change of q and v.
double BdfIntegrator::iterate_reduced(StepReport& report) {
  const std::size_t n = theta_.size(), m = level_.size();
  const double hp = formula_.hp;
  System& system = equations_.system();
  stage_residuals(trial_);
  const Span first(rhs_.data(), n + m), second(rhs_.data() + n + m, n + m);
  if (m > 0) {
    equations_.level(trial_.v, equations_.nu(), level_);
    const Span c1 = first.subspan(n), c2 = second.subspan(n);
    std::fill(rhs_.begin(), rhs_.end(), 0.0);
    equations_.kkt().multiply_phi_q(r2_, c1);
    equations_.kkt().multiply_phi_q(r1_, c2);
    const ConstSpan phi = equations_.phi();
    for (std::size_t i = 0; i < m; ++i) {
      c1[i] = -level_[i] - hp * c1[i];
      c2[i] = -phi[i] - hp * c2[i] + hp * level_[i];
    }
    equations_.solve(rhs_, 2);
  } else {
    std::fill(rhs_.begin(), rhs_.end(), 0.0);
  }
  for (std::size_t i = 0; i < n; ++i) {
    dv_[i] = hp * r2_[i] + first[i];
    dq_[i] = hp * (r1_[i] + dv_[i]) + second[i];
    trial_.v[i] += dv_[i];
  }
  system.retract(trial_.q, dq_, trial_.q);

  equations_.evaluate_constraints(trial_.t, trial_.q, trial_.v);
  equations_.motion(trial_.view(), f_);
  report.residual = max_norm(f_);
  equations_.level(trial_.a, equations_.gamma(), level_);
  for (std::size_t i = 0; i < n; ++i) first[i] = -f_[i];
  for (std::size_t i = 0; i < m; ++i) first[n + i] = -level_[i];
  equations_.solve(first, 1);
  for (std::size_t i = 0; i < n; ++i) {
    const double da = first[i];
    trial_.a[i] += da;
    trial_.v[i] += hp * da;
    work_n_[i] = hp * hp * da;
    dv_[i] += hp * da;
    dq_[i] += work_n_[i];
  }
  for (std::size_t i = 0; i < m; ++i) trial_.lambda[i] += first[n + i];
  system.retract(trial_.q, work_n_, trial_.q);
  system.local(history_.q(0), trial_.q, theta_);
  // The levels at the new state: the next iteration starts from them, or the step ends with them.
  equations_.evaluate_constraints(trial_.t, trial_.q, trial_.v);
  return std::max(norm(dq_, weight_q_), norm(dv_, weight_v_));
}

bool BdfIntegrator::constraints_hold(StepReport& report) {
  report.levels.motion = report.residual;
  if (level_.empty()) return true;
  report.levels.position = max_norm(equations_.phi());
  equations_.level(trial_.v, equations_.nu(), level_);
  report.levels.velocity = max_norm(level_);
  equations_.level(trial_.a, equations_.gamma(), level_);
  report.levels.acceleration = max_norm(level_);
  const double tolerance = options_.constraint_tolerance;
  return report.levels.position <= tolerance &&
         report.levels.velocity <= tolerance * std::max(1.0, max_norm(trial_.v)) &&
         report.levels.acceleration <= tolerance * std::max(1.0, max_norm(trial_.a));
}

BdfIntegrator::Outcome BdfIntegrator::solve_reduced(StepReport& report) {
  equations_.evaluate_constraints(trial_.t, trial_.q, {});
  double previous = 0, first = 0;
  for (int iteration = 1; iteration <= newton_limit_; ++iteration) {
    const double change = iterate_reduced(report);
    report.newton_iterations = iteration;
    if (!std::isfinite(change)) return Outcome::diverged;
    if (iteration == 1) first = change;
    if (iteration > 1 && previous > 0) {
      report.newton_rate = change / previous;
      rate_ = std::max(0.3 * rate_, report.newton_rate);
    }
    const double rate = std::min(rate_, 0.9);
    const bool small = change * rate / (1 - rate) <= options_.newton_tolerance || change == 0;
    if (small && constraints_hold(report)) {
      rate_poor_ = report.newton_rate > options_.refactor_rate && change > 1e-9;
      return Outcome::converged;
    }
    // At round-off the change stops falling although nothing is wrong. With a new factor that is the end of the road;
    // with an old one a new factor is tried first.
    const bool stagnant = iteration >= 3 && (change == 0 || report.newton_rate > 0.7);
    if (stagnant && change < (factor_fresh_ ? 0.1 : 1e-4)) {
      static_cast<void>(constraints_hold(report));
      return Outcome::converged;
    }
    if (iteration > 2 && report.newton_rate > 2 && change > first) return Outcome::diverged;
    previous = change;
  }
  // Round-off that wanders, far below the tolerance, with a new factor: there is nothing better to be had.
  if (factor_fresh_ && previous < 1e-3) {
    static_cast<void>(constraints_hold(report));
    return Outcome::converged;
  }
  return Outcome::slow;
}

BdfIntegrator::Outcome BdfIntegrator::solve_step(StepReport& report) {
  return options_.iteration == BdfIteration::reduced ? solve_reduced(report) : solve_full(report);
}

double BdfIntegrator::error_estimate(int order) {
  // Local error of the formula of this order: h'/(t - t_{n-k}) (y - y_pred), y_pred through k + 1 past points. It
  // follows from the error of interpolation, y^(k+1)/(k+1)! prod(t - t_j), in the value of the predictor and in the
  // derivative.
  const int points = order + 1;
  if (history_.size() < points) return 0;
  std::array<double, kMaxBdfOrder + 2> w{}, d{};
  value_weights(formula_.t, history_.times(points), w);
  derivative_weights(formula_.t, history_.times(order), d);
  const double factor = 1 / (d[0] * (formula_.t - history_.time(order)));
  for (std::size_t i = 0; i < theta_.size(); ++i) {
    dq_[i] = theta_[i];
    dv_[i] = trial_.v[i];
  }
  for (int j = 0; j < points; ++j) {
    const double wj = w[static_cast<std::size_t>(j)];
    const ConstSpan theta = history_.theta(j), v = history_.v(j);
    for (std::size_t i = 0; i < theta_.size(); ++i) {
      dq_[i] -= wj * theta[i];
      dv_[i] -= wj * v[i];
    }
  }
  const double error = norm(dq_, weight_q_);
  return factor * (options_.test_velocity ? std::max(error, norm(dv_, weight_v_)) : error);
}

double BdfIntegrator::clip(double h, double t_limit) const {
  const double left = t_limit - state_.t;
  if (options_.fixed_step > 0) return left < 1.01 * h ? left : h;
  h = std::min(h, options_.max_step);
  if (left <= 1.0000001 * h) return left;
  return left < 2 * h ? left / 2 : h;
}

bool BdfIntegrator::attempt(double h, bool retry, StepReport& report) {
  set_formula(h, order_);
  predict();
  ensure_factor(retry);
  const Outcome outcome = solve_step(report);
  if (outcome == Outcome::converged) return true;
  ++report.newton_failures;
  return false;
}

// True where more rows of Phi_q depend on each other to within a hundredth than do exactly: the rank is about to drop.
bool BdfIntegrator::near_singular() {
  if (state_.lambda.empty()) return false;
  equations_.evaluate_constraints(state_.t, state_.q, {});
  const SparsePattern& pattern = equations_.system().constraint_pattern();
  constexpr double kNear = 1e-2, kExact = 1e-8;
  return find_dependent_rows(pattern, equations_.phi_q(), kNear).size() >
         find_dependent_rows(pattern, equations_.phi_q(), kExact).size();
}

// Near a singular position of the mechanism (two branches meet: the rank of Phi_q drops at the distance s) the reduced
// iteration converges with the rate h' |v| / s, because it drops the curvature of the constraints, so the steps would
// shrink with the distance for ever. Where they have collapsed, one step of the size they had goes over the place. The
// past points are close together then, which makes h' = h / order, and with order 3 the rate is near a third: slow, but
// safe. The error estimate of this one step may exceed the tolerance by kCrossingError.
bool BdfIntegrator::cross(double t_limit, StepReport& report) {
  constexpr double kCrossingError = 300;
  if (!near_singular()) return false;
  const int order = order_;
  bool done = false;
  newton_limit_ = 60;
  for (const double fraction : {0.5, 1.0, 0.25, 2.0}) {
    order_ = std::min(3, std::max(1, history_.size() - 1));
    if (!attempt(std::min(fraction * h_calm_, t_limit - state_.t), true, report)) continue;
    report.error = error_estimate(order_);
    done = report.error <= kCrossingError;
    if (done) break;
  }
  newton_limit_ = options_.max_newton;
  if (!done) order_ = order;
  report.crossings = done ? 1 : 0;
  return done;
}

StepReport BdfIntegrator::step(double t_limit) {
  if (history_.size() == 0) throw std::logic_error("start() was not called");
  if (t_limit <= state_.t) throw std::invalid_argument("t_limit lies before the present time");
  StepReport report;
  const long factorizations = equations_.counts().factorizations;
  const bool fixed = options_.fixed_step > 0;
  error_weights();
  if (options_.fixed_order > 0) order_ = std::min({options_.fixed_order, order_ + 1, std::max(1, history_.size() - 1)});
  bool retry = false;
  for (;;) {
    const double h = clip(h_, t_limit);
    check_step(h, t_limit);
    if (!attempt(h, retry, report)) {
      if (fixed && factor_fresh_) {
        throw Error(StatusCode::accuracy_not_reached,
                    "Newton did not converge at t = " + std::to_string(formula_.t) + " with the fixed step");
      }
      if (!fixed && factor_fresh_) h_ = h / 4;
      retry = true;
    } else {
      retry = false;
      if (fixed) break;
      report.error = error_estimate(order_);
      if (report.error <= 1) break;
      ++report.error_failures;
      h_ = h;
      reject(report.error, report.error_failures);
    }
    if (!fixed && h_ < kCollapse * h_calm_ && cross(t_limit, report)) break;
  }
  report.factorizations = static_cast<int>(equations_.counts().factorizations - factorizations);
  if (options_.measure_blocks) measure_blocks();
  accept(report);
  return report;
}

void BdfIntegrator::check_step(double h, double t_limit) const {
  const double smallest =
      options_.min_step > 0 ? options_.min_step : 1e-14 * std::max(std::abs(state_.t), std::abs(t_limit - state_.t));
  if (h > smallest || t_limit - state_.t <= smallest) return;
  throw Error(StatusCode::accuracy_not_reached,
              "the step size fell below its least value at t = " + std::to_string(state_.t) + " (order " +
                  std::to_string(order_) + "): the motion may be singular there, or the tolerances too tight");
}

void BdfIntegrator::reject(double error, int failures) {
  if (failures >= 3) order_ = 1;
  h_ *= failures == 1 ? std::clamp(0.9 * std::pow(2 * error, -1.0 / (order_ + 1)), 0.2, 0.9) : 0.25;
  steps_at_order_ = 0;
}

void BdfIntegrator::accept(StepReport& report) {
  report.order = formula_.order;
  report.h = formula_.h;
  report.t = formula_.t;
  const double error = report.error;
  if (options_.fixed_step == 0) {
    h_ = formula_.h;
    choose_step(error);
  }
  // A memory of step sizes that fades with time, over ten of them, so not while the steps collapse.
  h_calm_ = h_calm_ > 0 ? std::max(h_calm_ * std::exp(-formula_.h / (10 * h_calm_)), formula_.h) : formula_.h;
  std::swap(state_, trial_);
  history_.push(state_.t, state_.q, state_.v, state_.lambda);
  equations_.system().accept(state_.view());
  count(report);
  report.index = counts_.steps;
}

void BdfIntegrator::choose_step(double error) {
  // Order and step for the next step, after the logic of CVODE: candidates k - 1, k, k + 1, each with its own estimate,
  // with the safety factors 6, 6, 10 on the error; a change must pay (ratio 1.2 for the step, orders are left alone for
  // k + 1 steps after a change). Ratios below 1.2 keep the step, so that the factor stays good.
  ++steps_at_order_;
  const auto ratio = [](double e, double bias, int k) { return 1 / (std::pow(bias * e, 1.0 / (k + 1)) + 1e-6); };
  double best = ratio(error, 6, order_);
  int order = order_;
  const int top = options_.fixed_order > 0 ? options_.fixed_order : options_.max_order;
  if (options_.fixed_order == 0 && steps_at_order_ > order_) {
    if (order_ > 1) {
      const double lower = ratio(error_estimate(order_ - 1), 6, order_ - 1);
      if (lower > best) best = lower, order = order_ - 1;
    }
    if (order_ < top && history_.size() >= order_ + 2) {
      const double higher = ratio(error_estimate(order_ + 1), 10, order_ + 1);
      if (higher > best) best = higher, order = order_ + 1;
    }
  }
  const double largest = counts_.steps < 10 ? 10.0 : 4.0;
  if (best < 1) {
    best = std::max(0.5, best);
  } else if (best < 1.2) {
    best = 1;
    order = std::min(order, order_);
  } else {
    best = std::min(best, largest);
  }
  if (order != order_) steps_at_order_ = 0;
  order_ = order;
  h_ *= best;
}

void BdfIntegrator::interpolate(double t, Span q, Span v) const {
  std::array<double, kMaxBdfOrder + 2> w{};
  const int points = std::min(formula_.order + 1, history_.size());
  value_weights(t, history_.times(points), w);
  std::vector<double> theta(v.size(), 0.0);
  std::fill(v.begin(), v.end(), 0.0);
  for (int j = 0; j < points; ++j) {
    const double factor = w[static_cast<std::size_t>(j)];
    const ConstSpan past_theta = history_.theta(j), past_v = history_.v(j);
    for (std::size_t i = 0; i < v.size(); ++i) {
      theta[i] += factor * past_theta[i];
      v[i] += factor * past_v[i];
    }
  }
  equations_.system().retract(history_.q(0), theta, q);
}

}  // namespace espalier::dynamics

#include "dynamics/integrators/bdf.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <tuple>

#include "dynamics/integrators/newton_limits.hpp"

namespace espalier::dynamics {

namespace {
// Per step that renews the factor because the configuration moved beyond its reach: the reach is tried again after some
// ln 2 / ln 1.02 = 35 of them, so that a wrong guess costs little either way.
constexpr double kReachGrowth = 1.02;
// A step is shortened at most so often because something switched in it unseen.
constexpr int kMostUnseen = 40;
}  // namespace

BdfIntegrator::BdfIntegrator(Equations& equations, const BdfOptions& options)
    : equations_(equations),
      options_(options),
      vectors_(equations),
      history_(equations.system(), std::max(options.max_order, options.fixed_order) + 2) {
  if (options.max_order < 1 || options.max_order > kMaxBdfOrder)
    throw std::invalid_argument("max_order must be 1 to 5");
  if (options.fixed_order < 0 || options.fixed_order > kMaxBdfOrder) {
    throw std::invalid_argument("fixed_order must be 0 to 5");
  }
  if (!(options.relative >= 0) || !(options.absolute > 0)) throw std::invalid_argument("tolerances must be positive");
  if (options.budget.given() && options.budget.lengths.size() != at(equations.sizes().velocity))
    throw std::invalid_argument("a budget needs to know of each coordinate what it is");
  if (options_.absolute_velocity <= 0) options_.absolute_velocity = options_.absolute;
  allocate();
}

void BdfIntegrator::allocate() {
  const auto n = at(equations_.sizes().velocity);
  const auto m = at(equations_.sizes().constraints);
  state_ = trial_ = State(equations_.sizes());
  for (auto* x : {&theta_, &theta_hat_, &v_hat_, &weight_q_, &weight_v_, &r1_, &r2_, &dq_, &dv_, &f_, &work_n_}) {
    x->assign(n, 0.0);
  }
  level_.assign(m, 0.0);
  rhs_.assign(2 * (n + m), 0.0);
}

void BdfIntegrator::start(const State& state) {
  vectors_.leave();
  state_ = state;
  trial_ = state;
  history_.clear();
  order_ = 1;
  steps_at_order_ = 0;
  factor_hp_ = own_error_ = latest_error_ = floor_ = 0;
  reach_ = std::numeric_limits<double>::infinity();
  measure_constraints();
  // Long enough for a past point; what is too short to go on with is said by step().
  const double found = std::max({first_step(), 1e-14 * std::abs(state.t), 1e-290});
  h_ = options_.fixed_step > 0 ? options_.fixed_step : options_.initial_step > 0 ? options_.initial_step : found;
  const double past = std::max(options_.fixed_step > 0 ? h_ : std::min(h_, found), 1e-14 * std::abs(state.t));
  projected_left_ = noisy_left_ = 0;
  first_.reset();
  first_left_ = options_.fixed_step > 0 && options_.fixed_order > 2 ? options_.fixed_order - 1 : 0;
  // The formula of order 1 wants one past point more for its predictor; a point on the parabola through the state at
  // t - h serves: it differs from the true past by O(h^3) in q and O(h^2) in v.
  for_coordinates([&](std::size_t i) {
    dq_[i] = past * (-state.v[i] + 0.5 * past * state.a[i]);
    dv_[i] = state.v[i] - past * state.a[i];
  });
  std::vector<double> q_past(state.q.size());
  equations_.system().retract(state.q, dq_, q_past);
  switching_ = switching_laws(equations_.system());
  equations_.system().accept(state.view());
  history_.push(state.t - past, q_past, dv_, state.lambda, equations_.pool());
  history_.push(state.t, state.q, state.v, state.lambda, equations_.pool());
}

void BdfIntegrator::start(const std::vector<State>& past) {
  if (past.empty()) throw std::invalid_argument("no past points");
  start(past.back());
  history_.clear();
  first_left_ = 0;
  for (const State& s : past) history_.push(s.t, s.q, s.v, s.lambda);
  order_ = std::max(1, std::min(history_.size() - 1, kMaxBdfOrder));
  if (options_.fixed_order > 0) order_ = std::min(order_, options_.fixed_order);
}

double BdfIntegrator::first_step() const {
  // Order 1: the local error h^2 |q''| / 2 shall be a hundredth of the tolerance. v'' is unknown at the start; |a| over
  // a millisecond stands in for it. The error test repairs a guess that was too large.
  std::vector<double> size(state_.v.size());
  equations_.system().magnitude(state_.q, size);
  const double acceleration_q = largest_of(
      equations_.pool(), size.size(), [&](std::size_t i) { return state_.a[i] / tolerance_of_position(i, size[i]); });
  const double acceleration_v =
      largest_of(equations_.pool(), size.size(), [&](std::size_t i) { return state_.a[i] / tolerance_of_velocity(i); });
  const bool budget = options_.budget.given();
  const double longest = budget ? 1e-3 * options_.budget.duration : 1e-3, part = budget ? 1e-3 : 1;
  double h = std::min(options_.max_step, longest);
  if (acceleration_q > 0) h = std::min(h, std::sqrt(0.02 * part / acceleration_q));
  if (acceleration_v > 0 && options_.test_velocity) h = std::min(h, std::sqrt(0.02 * part * longest / acceleration_v));
  return h;
}

void BdfIntegrator::ensure_factor(bool retry) {
  const bool step_left = factor_hp_ > 0 && std::abs(formula_.hp / factor_hp_ - 1) > options_.refactor_step;
  const bool pattern_changed = equations_.update_pattern();
  if (on_device() && pattern_changed) throw Error(StatusCode::device_error, "the pattern of K has changed");
  const bool none = factor_hp_ == 0 || pattern_changed;
  const double distance = none ? 0.0 : distance_from_factor();
  const bool moved = distance > reach_;
  if (retry && !factor_fresh_) {
    reach_ = 0.5 * distance;
  } else if (moved) {
    reach_ *= kReachGrowth;
  }
  const bool was_turned = std::exchange(turned_, false), poor = retry || rate_poor_;
  if (!none && !poor && !step_left && !moved) {
    factor_fresh_ = false;
    return;
  }
  equations_.evaluate_constraints(trial_.t, trial_.q, {});
  // Where a factor that was turned does not do, a new one is due.
  // measure_blocks() looks at the matrix of the factor itself.
  const bool may_turn = !none && !step_left && !options_.measure_blocks && equations_.kkt().turning_may_pay();
  if (may_turn && !(poor && (was_turned || factor_fresh_))) {
    if (on_device()) {  // turned factors are the host's
      leave_device();
      begin_attempt(formula_.h);
      equations_.evaluate_constraints(trial_.t, trial_.q, {});
    }
    if (turn_factor()) return;
  }
  renew_factor(none        ? counts_.refactor_first
               : retry     ? counts_.refactor_failed
               : step_left ? counts_.refactor_step
                           : counts_.refactor_rate);
}

// In units of the tolerance of q: how far the predicted configuration lies from the one of the factor.
double BdfIntegrator::distance_from_factor() {
  if (!on_device()) {
    equations_.system().local(placed_q_, trial_.q, work_n_);
    return norm(work_n_, weight_q_);
  }
  device_motion().run(WayFromFactor{});
  for (const OwnCoordinates& c : share().owners) c.local(placed_q_, trial_.q, work_n_);
  const MotionRecord record = measure({.largest = {}, .sums = {{&MotionArrays::work, &MotionArrays::weight_q}}});
  return std::sqrt(record.sum[0] / static_cast<double>(work_n_.size()));
}

bool BdfIntegrator::turn_factor() {
  if (!equations_.turn_factor(factor_q_, trial_.q)) return false;
  copy(equations_.pool(), trial_.q, placed_q_);
  factor_fresh_ = rate_poor_ = false;
  turned_ = true;
  rate_ = 0.5;
  return true;
}

void BdfIntegrator::renew_factor(long& reason) {
  ++reason;
  const TangentWeights weights{1, formula_.hp, formula_.hp * formula_.hp};
  if (on_device()) {
    const StateView bodies = vectors_.state(trial_);
    equations_.factorize(trial_.view(), weights, &bodies);
    place_factor_there();
  } else {
    equations_.factorize(trial_.view(), weights);
    factor_q_ = placed_q_ = trial_.q;
  }
  factor_hp_ = formula_.hp;
  factor_fresh_ = true;
  rate_poor_ = false;
  rate_ = 0.5;
}

double BdfIntegrator::clip(double h, double t_limit) const {
  const double left = t_limit - state_.t;
  if (options_.fixed_step > 0) return left < 1.01 * h ? left : h;
  h = std::min(h, options_.max_step);
  if (left <= 1.0000001 * h) return left;
  return left < 2 * h ? left / 2 : h;
}

/// attempt(), where a predicted state that is none (an element inside out, forces that are no numbers) is a failure
/// too, unless the step is constant or shorter than any that could be to blame.
bool BdfIntegrator::attempt_anywhere(double h, bool retry, StepReport& report) {
  constexpr double kBlameless = 1e-9;  // of the first step that was tried from here
  longest_try_ = std::max(longest_try_, h);
  try {
    return attempt(h, retry, report);
  } catch (const Error& error) {
    if (options_.fixed_step > 0 || error.status().code != StatusCode::singular || h < kBlameless * longest_try_) throw;
    ++report.newton_failures;
    factor_hp_ = 0;
    factor_fresh_ = true;  // there is none that a new one could be better than
    return false;
  }
}

// Once more from where it stands, as long as the system changes multipliers of its own.
BdfIntegrator::Outcome BdfIntegrator::solve_augmented(StepReport& report) {
  Outcome outcome = solve_step(report);
  for (int round = 0; outcome == Outcome::converged && equations_.system().augment(trial_.view()); ++round)
    outcome = round < kMostAugmentations ? solve_step(report) : Outcome::slow;
  return outcome;
}

void BdfIntegrator::begin_attempt(double h) {
  set_formula(h, order_);
  predict();
}

bool BdfIntegrator::attempt(double h, bool retry, StepReport& report) {
  begin_attempt(h);
  report.crossings = 0;
  if (projected_left_ == 0) {
    ensure_factor(retry);
    if (may_enter_device()) enter_device();
    if (solve_augmented(report) == Outcome::converged) return true;
    ++report.newton_failures;
    if (!factor_fresh_ || options_.iteration != DaeIteration::reduced || level_.empty()) return false;
    leave_device();
    begin_attempt(h);
  }
  report.crossings = 1;
  if (solve_projected(report) == Outcome::converged) return true;
  ++report.newton_failures;
  projected_left_ = 0;
  return false;
}

// Where a GPU has lost factor or vectors, the host takes the step anew: it has all but the trial state.
StepReport BdfIntegrator::step(double t_limit) {
  if (history_.size() == 0) throw std::logic_error("start() was not called");
  if (t_limit <= state_.t) throw std::invalid_argument("t_limit lies before the present time");
  const std::tuple before(order_, steps_at_order_, h_);
  try {
    return step_here(t_limit);
  } catch (const Error& error) {
    if (!vectors_.host_can_continue(error)) throw;
    continue_on_host(error);
  }
  std::tie(order_, steps_at_order_, h_) = before;
  return step_here(t_limit);
}

StepReport BdfIntegrator::step_here(double t_limit) {
  StepReport report;
  const long factorizations = equations_.counts().factorizations;
  const bool fixed = options_.fixed_step > 0;
  if (vectors_.lost()) leave_device();
  error_weights();
  if (options_.fixed_order > 0) order_ = std::min({options_.fixed_order, order_ + 1, std::max(1, history_.size() - 1)});
  bool retry = false;
  int unseen = 0;
  longest_try_ = 0;
  for (;;) {
    const double h = clip(h_, t_limit);
    check_step(h, t_limit);
    if (fixed && first_left_ > 0 && first_points(h, report)) break;
    if (!attempt_anywhere(h, retry, report)) {
      if (fixed && factor_fresh_) {
        throw Error(StatusCode::accuracy_not_reached,
                    "Newton did not converge at t = " + std::to_string(formula_.t) + " with the fixed step");
      }
      if (!fixed && factor_fresh_) h_ = h / 4;
      retry = true;
      continue;
    }
    retry = false;
    if (fixed) break;
    report.error = error_estimate(order_);
    if (report.error > 1) {
      ++report.error_failures;
      h_ = h;
      reject(report.error, report.error_failures);
      continue;
    }
    const double share = unseen < kMostUnseen ? std::min(growing_share(), unseen_share()) : 1;
    if (share >= 1) break;
    ++report.error_failures;
    ++unseen;
    h_ = share * h;
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

// The formula of order k wants k points that are as good as it is; one that comes up from order 1 brings an error of
// h^2 along that no later order takes away. @return false where that is not to be had: forces that jump, vibrations
// that steps of this length do not resolve
bool BdfIntegrator::first_points(double h, StepReport& report) {
  constexpr double kTighter = 1e-4;
  constexpr int kMostSteps = 300;
  if (!first_) {
    BdfOptions tight = options_;
    tight.fixed_step = 0;
    tight.fixed_order = 0;
    tight.max_order = kMaxBdfOrder;
    tight.relative = kTighter * options_.relative;
    tight.absolute = kTighter * options_.absolute;
    tight.absolute_velocity = kTighter * options_.absolute_velocity;
    first_ = std::make_shared<BdfIntegrator>(equations_, tight);
    first_->start(state_);
  }
  const double end = state_.t + h;
  try {
    while (first_->state().t < end) {
      if (first_->counts().steps == kMostSteps) throw Error(StatusCode::accuracy_not_reached, "too many steps");
      const StepReport part = first_->step(end);
      report.newton_iterations += part.newton_iterations;
      report.levels = part.levels;
      report.residual = part.residual;
    }
  } catch (const Error& error) {
    if (error.status().code != StatusCode::accuracy_not_reached) throw;
    first_.reset();
    first_left_ = 0;
    factor_hp_ = 0;
    return false;
  }
  trial_ = first_->state();
  set_formula(h, 1);
  if (--first_left_ == 0) first_.reset();
  return true;
}

void BdfIntegrator::reject(double error, int failures) {
  if (failures >= 3) order_ = 1;
  h_ *= failures == 1 ? std::clamp(0.9 * std::pow(2 * error, -1.0 / (order_ + 1)), 0.2, 0.9) : 0.25;
  steps_at_order_ = 0;
}

// A step that the caller's limit cut that short says nothing of the length of the next one, and a point that close to
// the last would leave differences of rounding errors: it takes that one's place, while the one before is near enough.
bool BdfIntegrator::sliver() const {
  constexpr double kShortestShare = 1e-3;
  return options_.fixed_step == 0 && formula_.h < kShortestShare * h_ && history_.size() > 1 &&
         formula_.t - history_.time(1) < 2 * h_;
}

void BdfIntegrator::accept(StepReport& report) {
  report.order = formula_.order;
  report.h = formula_.h;
  report.t = formula_.t;
  if (on_device()) vectors_.fetch_state(trial_);
  const double error = report.error;
  const int points_before = history_.size();
  if (sliver()) {
    history_.drop_newest();
  } else if (options_.fixed_step == 0) {
    h_ = formula_.h;
    choose_step(error);
    h_ = std::min(h_, growing_step_);
  }
  if (report.crossings > 0) {
    projected_left_ = std::max(projected_left_ - 1, 0);
    noisy_left_ = history_.depth();
  } else if (noisy_left_ > 0) {
    --noisy_left_;
  }
  if (on_device()) vectors_.fetch_state(trial_);
  const bool replaces = history_.size() < points_before;
  std::swap(state_, trial_);
  history_.push(state_.t, state_.q, state_.v, state_.lambda, equations_.pool(), on_device() ? &share() : nullptr);
  if (on_device()) push_there(replaces);
  equations_.system().accept(state_.view());
  count(report);
  report.index = counts_.steps;
}

}  // namespace espalier::dynamics

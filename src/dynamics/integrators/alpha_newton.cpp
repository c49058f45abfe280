// Newton's iteration of generalized-alpha, and when it ends.
#include <algorithm>
#include <cmath>

#include "base/at.hpp"
#include "dynamics/integrators/generalized_alpha.hpp"
#include "dynamics/integrators/newton_limits.hpp"

namespace espalier::dynamics {

namespace {
// Changes of the size of rounding hide what an old factor is worth. The equations of motion show it, which have less
// rounding than the constraints: of a change they keep what the factor does wrong. Above this part of what the step
// began with, another pass is taken or the factor renewed. Otherwise the part of a that lags behind in each step the
// same way adds up (spatial slider crank, steps of 10 microseconds: 1e-4 of q after half a second instead of 1e-7).
constexpr double kTrusted = 2e-3;
// Rate of convergence where the step before took one pass, which does not tell it, while its factor aged (spatial
// slider crank, 200 steps: believed 1e-5 to 1e-3 over eight steps of one pass, in truth up to 0.02).
constexpr double kUnmeasuredRate = 0.02;
// With a search, a change after which the forces are larger than this part of what they were is halved, so often.
// Contacts that close and open, and friction that sticks and slips, make Newton jump to and fro (models/sprocket.toml
// with 60 links: 1,500 steps without a division instead of 2,936 with 8 of them).
constexpr double kNoBetter = 0.95;
constexpr int kMostHalves = 3;
// What moves by less than this part of the largest coordinate in a step stands still; accelerations and multipliers of
// which rounding is more than kNothing are nothing but rounding then.
constexpr double kStandsStill = 1e-13, kNothing = 0.01;
}  // namespace

void GeneralizedAlpha::predict() {
  trial_.t = state_.t + h_;
  // On the line through the last two points, as far as that served in the step before. Chain of 400 bars, constraints
  // to 1e-12: 2.9 passes of Newton a step where the last values alone need 4.1.
  const double ahead = h_before_ > 0 ? trend_ * h_ / h_before_ : 0;
  for (std::size_t i = 0; i < trial_.lambda.size(); ++i) {
    trial_.lambda[i] = state_.lambda[i] + ahead * (state_.lambda[i] - lambda_before_[i]);
  }
  run(PredictedAcceleration{ahead});
  reach();
  weigh();
}

double GeneralizedAlpha::weight_of(double size) const {
  return 1 / (options_.tolerance * (options_.relative * size + options_.absolute));
}

// The weights of changes of q, and size_q_.
void GeneralizedAlpha::weigh() {
  if (on_device()) return weigh_there();
  equations_.system().magnitude(state_.q, weight_);
  size_q_ = largest_of(equations_.pool(), weight_.size(), [&](std::size_t i) {
    const double size = weight_[i];
    weight_[i] = weight_of(size);
    return std::max(size, std::abs(delta_[i]));
  });
}

// The trial state that a_step_ leads to.
void GeneralizedAlpha::reach() {
  run(StateReached{c_v_, c_q_});
  if (on_device()) return reach_there();
  equations_.system().retract(state_.q, delta_, trial_.q);
  carry({trial_.a, trial_.v});
}

void GeneralizedAlpha::constraints_of_trial() {
  equations_.evaluate_constraints(trial_.t, trial_.q, {});
  equations_.set_slip(trial_.v, c_q_ / c_v_);
}

// From the axes of q_n to those of q_n (+) delta. Those of bodies on a GPU never turn.
void GeneralizedAlpha::carry(std::initializer_list<Span> vectors) const {
  const std::span<const Span> all(vectors.begin(), vectors.size());
  if (!on_device()) return equations_.system().carry(delta_, all);
  for (const OwnCoordinates& c : vectors_.share().owners) c.carry(delta_, all);
}

// The multiple of the last change that would have predicted this step best (least squares, weighted), in [0, 1]: near 1
// in smooth motion, 0 where the accelerations of stiff modes change their sign from step to step, which a whole change
// would triple (wheelset: two passes of Newton a step instead of three).
void GeneralizedAlpha::learn_trend() {
  const double along = sum_of(equations_.pool(), a_before_.size(), [&](std::size_t i) {
    return weight_[i] * weight_[i] * (state_.a[i] - a_before_[i]) * (a_step_[i] - state_.a[i]);
  });
  const double square = sum_of(equations_.pool(), a_before_.size(), [&](std::size_t i) {
    const double last = weight_[i] * (state_.a[i] - a_before_[i]);
    return last * last;
  });
  set_trend(along, square);
}

void GeneralizedAlpha::set_trend(double along, double square) {
  trend_ = square > 0 && h_before_ > 0 ? std::clamp(along * h_before_ / (square * h_), 0.0, 1.0) : 1.0;
}

double GeneralizedAlpha::scaled_norm(ConstSpan a, ConstSpan lambda) const {
  const ConstSpan scale = equations_.kkt().scale();
  return scaled_multipliers(lambda,
                            largest_of(equations_.pool(), a.size(), [&](std::size_t i) { return a[i] / scale[i]; }));
}

// The larger one of `largest` and what lambda is in the scale of K.
double GeneralizedAlpha::scaled_multipliers(ConstSpan lambda, double largest) const {
  const ConstSpan scale = equations_.kkt().scale();
  for (std::size_t i = 0; i < lambda.size(); ++i) {
    if (!equations_.dropped()[i]) largest = std::max(largest, std::abs(lambda[i]) / scale[delta_.size() + i]);
  }
  return largest;
}

double GeneralizedAlpha::scaled_force(ConstSpan f) const {
  const ConstSpan scale = equations_.kkt().scale();
  return largest_of(equations_.pool(), f.size(), [&](std::size_t i) { return f[i] * scale[i]; });
}

// The least error that a method of second order makes in v' and lambda, h^2 |v'''| / 12, from their second differences;
// 0 where there are none yet. @param change  the last one
double GeneralizedAlpha::local_error(const Change& change) const {
  if (h_before_ == 0) return 0;
  const std::size_t n = delta_.size(), m = trial_.lambda.size();
  const double ratio = h_ / h_before_, unequal = 2 * h_ / (h_ + h_before_);
  for (std::size_t i = 0; i < m; ++i)
    second_[n + i] = trial_.lambda[i] - state_.lambda[i] - ratio * (state_.lambda[i] - lambda_before_[i]);
  const ConstSpan second = second_;
  if (on_device()) return unequal / 12 * scaled_multipliers(second.subspan(n), change.second);
  for_coordinates([&](std::size_t i) { second_[i] = a_step_[i] - state_.a[i] - ratio * (state_.a[i] - a_before_[i]); });
  return unequal / 12 * scaled_norm(second.first(n), second.subspan(n));
}

// Takes back halves of the last change until the forces are smaller than before it. @pre motion() at the trial state
double GeneralizedAlpha::search_back(double before) {
  double force = scaled_force(f_), part = 1;
  for (int k = 0; k < kMostHalves && !(force <= kNoBetter * before); ++k) {
    part *= 0.5;
    for_coordinates([&](std::size_t i) { a_step_[i] -= part * change_[i]; });
    for (std::size_t i = 0; i < trial_.lambda.size(); ++i) trial_.lambda[i] -= part * change_[delta_.size() + i];
    reach();
    constraints_of_trial();
    equations_.motion(trial_.view(), f_);
    force = scaled_force(f_);
  }
  return force;
}

// K [da; dlambda] = [-F; -Phi / c_q]. @pre constraints are evaluated at the trial state
// @param before force before the last change, which is searched along; 0: it is taken whole
GeneralizedAlpha::Change GeneralizedAlpha::iterate(StepReport& report, double before) {
  const std::size_t n = delta_.size(), m = trial_.lambda.size();
  Change change;
  find_forces(change, report, before);
  const ConstSpan phi = equations_.phi();
  for (std::size_t i = 0; i < m; ++i) rhs_[n + i] = -phi[i] / c_q_;
  if (on_device())
    solve_there();
  else
    equations_.solve(rhs_);
  take_change(change, report);
  for (std::size_t i = 0; i < m; ++i) trial_.lambda[i] += rhs_[n + i];
  reach();
  constraints_of_trial();
  return change;
}

// The upper part of the right-hand side.
void GeneralizedAlpha::find_forces(Change& change, StepReport& report, double before) {
  if (on_device()) return find_forces_there();
  equations_.motion(trial_.view(), f_);
  change.force = before > 0 ? search_back(before) : scaled_force(f_);
  report.residual = largest_of(equations_.pool(), f_.size(), [&](std::size_t i) { return rhs_[i] = -f_[i]; });
}

// K takes the change of q at the trial state; that of delta, and so of a, is T(delta)^-1 times it.
void GeneralizedAlpha::take_change(Change& change, StepReport& report) {
  const std::size_t n = delta_.size();
  const double c = std::max(c_q_, h_ * c_v_);
  double sum = 0;  // of (c da weight)^2
  if (on_device()) {
    sum = c * c * take_change_there(change, report);
  } else {
    const Span da(rhs_.data(), n), dlambda = Span(rhs_).subspan(n);
    change.scaled = scaled_norm(da, dlambda);
    equations_.system().rate_of_velocity(delta_, da, da);
    change.q = c_q_ * max_norm(equations_.pool(), da);
    if (search_) change_ = rhs_;
    sum = sum_of(equations_.pool(), n, [&](std::size_t i) {
      a_step_[i] += da[i];
      const double weighted = c * da[i] * weight_[i];
      return weighted * weighted;
    });
  }
  change.weighted = n == 0 ? 0.0 : std::sqrt(sum / static_cast<double>(n));
  if (!std::isfinite(sum)) change.scaled = sum;
}

// True where changes that stand still have met rounding. With an old factor that is believed only at the level where it
// was seen with a new one; elsewhere the factor is renewed, and the next pass tells.
bool GeneralizedAlpha::rounding_ends(const Change& change, double rate) {
  const bool tiny = change.q <= kRounding * size_q_;
  if (!(tiny && rate > kStill) && !(change.weighted <= 0.1 && rate > 0.9)) return false;
  const double level = c_q_ * change.scaled;
  if (!fresh_) return level <= kAboveFloor * floor_;
  floor_ = std::max(level, 0.5 * floor_);
  force_floor_ = change.force;
  return true;
}

GeneralizedAlpha::Outcome GeneralizedAlpha::end_at_rounding(const Change& change, StepReport& report) {
  rate_poor_ = false;
  double size = 0, speed = 0;
  if (on_device()) {
    run(ScaledAcceleration{});
    const MotionRecord record = measure({.largest = {&MotionArrays::work, &MotionArrays::v}, .sums = {}});
    size = scaled_multipliers(trial_.lambda, record.largest[0]);
    speed = record.largest[1];
  } else {
    size = scaled_norm(trial_.a, trial_.lambda);
    speed = max_norm(equations_.pool(), trial_.v);
  }
  const bool rests = h_ * speed <= kStandsStill * size_q_ && change.scaled > kNothing * size;
  report.rounding = size > 0 && !rests ? change.scaled / size : 0;
  local_error_ = local_error(change);
  return Outcome::converged;
}

GeneralizedAlpha::Outcome GeneralizedAlpha::solve(StepReport& report) {
  Change change;
  double previous = 0, first = 0, first_force = 0, last = 0;
  int renewed = 0;
  report.newton_rate = 0;
  report.rounding = 0;
  for (int iteration = 1; iteration <= options_.max_newton; ++iteration) {
    const bool searched = search_ && fresh_ && iteration > 1 && change.q > kRounding * size_q_;
    change = iterate(report, searched ? change.force : 0);
    report.newton_iterations = iteration;
    report.levels.position = max_norm(equations_.phi());
    if (!std::isfinite(change.scaled)) return Outcome::diverged;
    if (iteration == 1) {
      first = change.scaled;
      first_force = change.force;
    }
    ++passes_of_factor_;
    const bool tiny = change.q <= kRounding * size_q_;
    const double seen = previous > 0 ? change.scaled / previous : 0, forces = last > 0 ? change.force / last : 0;
    if (previous > 0) report.newton_rate = seen;
    if (iteration > 1) {
      rate_ = std::max(0.3 * rate_, tiny && seen > kStill ? forces : std::max(seen, forces));
      rate_measured_ = true;
    }
    const double rate = std::min(rate_measured_ ? rate_ : std::max(rate_, kUnmeasuredRate), 0.9);
    const double left = rate / (1 - rate);
    const double own = local_error(change), allowed = newton_share_ * std::max(own, kMemory * local_error_);
    const double trusted_force = std::max(kTrusted * first_force, kAboveFloor * force_floor_);
    const bool trusted = fresh_ || !tiny || (last > 0 && change.force <= trusted_force);
    const bool holds = report.levels.position <= options_.constraint_tolerance && trusted;
    if (change.scaled == 0 || (holds && left * change.scaled <= allowed && left * change.weighted <= 1)) {
      // The change hides in rounding what the forces show.
      if (tiny && seen > std::max(10 * forces, kTrusted)) return end_at_rounding(change, report);
      rate_poor_ = wants_new_factor();
      if (iteration == 1) {  // one pass tells nothing of the rate
        rate_ = std::min(2 * rate_, 0.5);
        rate_measured_ = false;
      }
      local_error_ = std::max(own, kMemory * local_error_);
      return Outcome::converged;
    }
    if (previous > 0 && trusted && rounding_ends(change, seen)) return end_at_rounding(change, report);
    if (iteration > 2 && seen > 2 && change.scaled > first && !tiny) return Outcome::diverged;
    // Even the passes that are left will not do at this rate, but a new factor will.
    if (!fresh_ && iteration > 2 && !tiny && change.scaled * std::pow(seen, options_.max_newton - iteration) > allowed)
      return Outcome::slow;
    const bool still =
        tiny && !fresh_ && last > 0 && (seen > kStill || (!trusted && change.force * forces > trusted_force));
    const bool slow =
        fresh_ && !tiny && iteration >= renewed + 2 && seen > std::max(kSlow, options_.refactor_rate.value_or(0));
    previous = still ? 0 : change.scaled;
    last = change.scaled;
    if (still || slow) {
      renewed = iteration;
      factorize(counts_.refactor_rate);
    }
  }
  // No standstill, no end: good enough for q, at least.
  if (fresh_ && change.weighted <= 0.1 && report.levels.position <= options_.constraint_tolerance)
    return end_at_rounding(change, report);
  return Outcome::slow;
}

}  // namespace espalier::dynamics

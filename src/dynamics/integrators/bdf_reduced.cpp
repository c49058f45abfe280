// The nonlinear equations of a step by the reduced iteration.
#include <algorithm>
#include <cmath>

#include "dynamics/integrators/bdf.hpp"
#include "dynamics/integrators/newton_limits.hpp"

namespace espalier::dynamics {

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

// The first two solves of a pass: q, then v at the new q, onto their levels along the BDF formulas. One after the
// other, because the velocity level turns with q: with both at the old q the error of a pass is that of the one before
// times 2 |omega| h' (0.12 in the engine, nine passes where four do).
// @pre constraints evaluated at the trial position
void BdfIntegrator::project_stages() {
  const std::size_t n = theta_.size(), m = level_.size();
  const double hp = formula_.hp;
  stage_residuals(trial_);
  for (std::size_t i = 0; i < n; ++i) dq_[i] = hp * (r1_[i] + hp * r2_[i]);
  for (std::size_t i = 0; i < n; ++i) dv_[i] = hp * r2_[i];
  if (m > 0) add_normal_part(equations_.phi(), dq_);
  equations_.system().retract(trial_.q, dq_, trial_.q);
  if (m > 0) {
    equations_.evaluate_constraints(trial_.t, trial_.q, {});
    equations_.level(trial_.v, equations_.nu(), level_);
    add_normal_part(level_, dv_);
  }
  for (std::size_t i = 0; i < n; ++i) trial_.v[i] += dv_[i];
}

// change += x, K [x; .] = [0; -violation - Phi_q,K change]: what the level lacks after the change, in normal
// directions.
void BdfIntegrator::add_normal_part(ConstSpan violation, Span change) {
  const std::size_t n = theta_.size(), m = level_.size();
  const Span x(rhs_.data(), n + m), lower = x.subspan(n);
  equations_.kkt().multiply_phi_q(change, lower);
  std::fill_n(x.begin(), n, 0.0);
  for (std::size_t i = 0; i < m; ++i) lower[i] = -violation[i] - lower[i];
  equations_.solve(x, 1, 1);
  for (std::size_t i = 0; i < n; ++i) change[i] += x[i];
}

// One pass of the reduced iteration; leaves the changes of q and v in dq_ and dv_. v and q get that part of da only
// that F asks for: what the acceleration level asks for is normal to the constraints and would take v and q off their
// levels.
void BdfIntegrator::iterate_reduced(StepReport& report) {
  const std::size_t n = theta_.size(), m = level_.size();
  const double hp = formula_.hp;
  System& system = equations_.system();
  project_stages();
  equations_.evaluate_constraints(trial_.t, trial_.q, trial_.v);
  equations_.motion(trial_.view(), f_);
  report.residual = max_norm(f_);
  equations_.level(trial_.a, equations_.gamma(), level_);
  const Span tangential(rhs_.data(), n + m), normal(rhs_.data() + n + m, n + m);
  std::fill(rhs_.begin(), rhs_.end(), 0.0);
  for (std::size_t i = 0; i < n; ++i) tangential[i] = -f_[i];
  for (std::size_t i = 0; i < m; ++i) normal[n + i] = -level_[i];
  const Index normal_columns = m > 0 ? 1 : 0;
  equations_.solve(m > 0 ? Span(rhs_) : tangential, 1 + normal_columns, normal_columns);
  for (std::size_t i = 0; i < n; ++i) {
    const double da = tangential[i];
    trial_.a[i] += da + normal[i];
    trial_.v[i] += hp * da;
    work_n_[i] = hp * hp * da;
    dv_[i] += hp * da;
    dq_[i] += work_n_[i];
  }
  for (std::size_t i = 0; i < m; ++i) trial_.lambda[i] += tangential[n + i] + normal[n + i];
  system.retract(trial_.q, work_n_, trial_.q);
  system.local(history_.q(0), trial_.q, theta_);
  // The levels at the new state: the next iteration starts from them, or the step ends with them.
  equations_.evaluate_constraints(trial_.t, trial_.q, trial_.v);
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

// What is left of the violations once q and v are as good as the error test asks for: projections of q, v and a along
// W^-1 Phi_q^T, which the formulas leave free, one after the other, without F. They contract with the change of Phi_q
// since the factor alone, while whole passes contract with the error of W too (engine: 0.2, up to eight passes more).
bool BdfIntegrator::finish_levels(StepReport& report) {
  constexpr int kMostRounds = 4;
  const std::size_t n = theta_.size(), m = level_.size();
  for (int round = 0; round < kMostRounds; ++round) {
    if (constraints_hold(report)) return true;
    if (report.levels.position > options_.constraint_tolerance) {
      std::fill(work_n_.begin(), work_n_.end(), 0.0);
      add_normal_part(equations_.phi(), work_n_);
      equations_.system().retract(trial_.q, work_n_, trial_.q);
      equations_.evaluate_constraints(trial_.t, trial_.q, {});
    }
    equations_.level(trial_.v, equations_.nu(), level_);
    std::fill(work_n_.begin(), work_n_.end(), 0.0);
    add_normal_part(level_, work_n_);
    for (std::size_t i = 0; i < n; ++i) trial_.v[i] += work_n_[i];
    equations_.evaluate_constraints(trial_.t, trial_.q, trial_.v);
    equations_.level(trial_.a, equations_.gamma(), level_);
    std::fill(work_n_.begin(), work_n_.end(), 0.0);
    add_normal_part(level_, work_n_);
    for (std::size_t i = 0; i < n; ++i) trial_.a[i] += work_n_[i];
    for (std::size_t i = 0; i < m; ++i) trial_.lambda[i] += rhs_[n + i];
    equations_.system().local(history_.q(0), trial_.q, theta_);
  }
  return constraints_hold(report);
}

// True if even the passes that are left will not do at this rate.
bool BdfIntegrator::hopeless(double change, double rate, int iteration) const {
  return rate >= 1 || change * std::pow(rate, options_.max_newton - iteration) > options_.newton_tolerance;
}

// Rounding of v where all are as large as the largest, in units of the tolerance, but at most half of it: passes cannot
// agree better at tolerances like 1e-13 (Andrews' mechanism: 0.1 to 0.4).
double BdfIntegrator::rounding_of_change() const {
  const double eps = std::numeric_limits<double>::epsilon() * max_norm(trial_.v);
  double sum = 0;
  for (const double w : weight_v_) sum += eps * eps * w * w;
  return std::min(0.5, std::sqrt(sum / static_cast<double>(weight_v_.size())));
}

// The step is shorter than the tolerance asks for: the run wants more of it than the tolerance says.
bool BdfIntegrator::step_is_held() const {
  return options_.fixed_step > 0 || formula_.h >= (1 - 1e-9) * options_.max_step;
}

// How far the iteration must go: to newton_tolerance of the tolerance, or of the formula's own error where that is
// smaller and the step is held short. A smaller step would otherwise keep an error of q and v that adds up over more
// steps, and one of a and lambda that grows with 1/h. Uses dq_ and dv_.
double BdfIntegrator::allowed_change() {
  if (!step_is_held()) return options_.newton_tolerance;
  latest_error_ = error_estimate(formula_.order);
  return options_.newton_tolerance * std::min(1.0, std::max(latest_error_, kMemory * own_error_));
}

// The changes stand still where nothing is wrong: at rounding. Without an error test, as GeneralizedAlpha does: with an
// old factor at the level only at which they did with a new one (elsewhere solve_reduced() renews it).
bool BdfIntegrator::rounding_ends(double change, const StepReport& report) {
  if (!step_is_held()) {
    const bool still = report.newton_iterations >= 3 && (change == 0 || report.newton_rate > 0.7);
    return still && change < (factor_fresh_ ? std::max(0.1, rounding_of_change()) : 1e-4);
  }
  if (!tiny_ || report.newton_rate <= kStill) return false;
  if (!factor_fresh_) return change <= kAboveFloor * floor_;
  floor_ = std::max(change, 0.5 * floor_);
  return true;
}

// The change of q and v of a pass in units of the tolerance; sets tiny_ and level_of_a_.
double BdfIntegrator::change_of_pass() {
  const double dv = formula_.hp * max_norm(dv_), a = formula_.hp * formula_.hp * max_norm(trial_.a);
  tiny_ = std::max(max_norm(dq_), dv) <= kRounding * size_q_;
  level_of_a_ = a > 0 ? dv / a : 0;
  return std::max(norm(dq_, weight_q_), norm(dv_, weight_v_));
}

BdfIntegrator::Outcome BdfIntegrator::solve_reduced(StepReport& report) {
  formula_is_projected_ = false;
  equations_.evaluate_constraints(trial_.t, trial_.q, {});
  double previous = 0, first = 0;
  int renewed = 0;
  const double rate_before = rate_;
  const bool held = step_is_held();
  report.newton_rate = report.rounding = 0;
  for (int iteration = 1; iteration <= options_.max_newton; ++iteration) {
    iterate_reduced(report);
    const double change = change_of_pass();
    report.newton_iterations = iteration;
    if (!std::isfinite(change)) return Outcome::diverged;
    if (iteration == 1) first = change;
    if (previous > 0) {
      report.newton_rate = change / previous;
      rate_ = std::max(0.3 * rate_, report.newton_rate);
    }
    const double rate = std::min(rate_, 0.9);
    // One pass tells nothing of the rate, and a step held short wants to know.
    const bool known = iteration > 1 || !held;
    const bool small = (known && change * rate / (1 - rate) <= allowed_change()) || change == 0;
    const bool at_floor = !small && previous > 0 && rounding_ends(change, report);
    if ((small || at_floor) && finish_levels(report)) {
      rate_poor_ = small && report.newton_rate > options_.refactor_rate && change > 1e-9;
      if (at_floor && held) rate_ = rate_before, report.rounding = level_of_a_;
      own_error_ = std::max(latest_error_, kMemory * own_error_);
      return Outcome::converged;
    }
    const bool still = held && tiny_ && !factor_fresh_ && report.newton_rate > kStill;
    const bool open = !(held && tiny_);
    if (!factor_fresh_ && open && !small && iteration > 1 && hopeless(change, report.newton_rate, iteration)) {
      return Outcome::slow;
    }
    if (iteration > 2 && open && report.newton_rate > 2 && change > first) return Outcome::diverged;
    // The predictor stretches what turns, so W at its state lacks the right geometric stiffness; after some passes the
    // state is good enough for a better W. The rate tells of it a pass later.
    const bool slow = factor_fresh_ && iteration >= std::max(3, renewed + 2) &&
                      report.newton_rate > std::max(kSlow, options_.refactor_rate) && (held ? open : change > 1e-3);
    previous = still ? 0 : change;
    if (slow || still) {
      renewed = iteration;
      renew_factor(counts_.refactor_rate);
    }
  }
  // Round-off that wanders, far below the tolerance, with a new factor: there is nothing better to be had.
  return factor_fresh_ && previous < 1e-3 && constraints_hold(report) ? Outcome::converged : Outcome::slow;
}

BdfIntegrator::Outcome BdfIntegrator::solve_step(StepReport& report) {
  return options_.iteration == BdfIteration::reduced ? solve_reduced(report) : solve_full(report);
}

}  // namespace espalier::dynamics

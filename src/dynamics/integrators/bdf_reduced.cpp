// The nonlinear equations of a step by the reduced iteration.
#include <algorithm>
#include <cmath>

#include "dynamics/integrators/bdf.hpp"

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

// The first two solves of a pass: v and q onto their levels along the BDF formulas. @pre constraints evaluated at the
// trial position
void BdfIntegrator::project_stages() {
  const std::size_t n = theta_.size(), m = level_.size();
  const double hp = formula_.hp;
  stage_residuals(trial_);
  const Span first(rhs_.data(), n + m), second(rhs_.data() + n + m, n + m);
  std::fill(rhs_.begin(), rhs_.end(), 0.0);
  if (m > 0) {
    equations_.level(trial_.v, equations_.nu(), level_);
    const Span c1 = first.subspan(n), c2 = second.subspan(n);
    equations_.kkt().multiply_phi_q(r2_, c1);
    equations_.kkt().multiply_phi_q(r1_, c2);
    const ConstSpan phi = equations_.phi();
    for (std::size_t i = 0; i < m; ++i) {
      c1[i] = -level_[i] - hp * c1[i];
      c2[i] = -phi[i] - hp * c2[i] + hp * level_[i];
    }
    equations_.solve(rhs_, 2);
  }
  for (std::size_t i = 0; i < n; ++i) {
    dv_[i] = hp * r2_[i] + first[i];
    dq_[i] = hp * (r1_[i] + dv_[i]) + second[i];
    trial_.v[i] += dv_[i];
  }
  equations_.system().retract(trial_.q, dq_, trial_.q);
}

// One pass of the reduced iteration; returns the weighted size of the change of q and v.
double BdfIntegrator::iterate_reduced(StepReport& report) {
  const std::size_t n = theta_.size(), m = level_.size();
  const double hp = formula_.hp;
  System& system = equations_.system();
  project_stages();
  equations_.evaluate_constraints(trial_.t, trial_.q, trial_.v);
  equations_.motion(trial_.view(), f_);
  report.residual = max_norm(f_);
  equations_.level(trial_.a, equations_.gamma(), level_);
  const Span first(rhs_.data(), n + m);
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
  formula_is_projected_ = false;
  equations_.evaluate_constraints(trial_.t, trial_.q, {});
  double previous = 0, first = 0;
  for (int iteration = 1; iteration <= options_.max_newton; ++iteration) {
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

}  // namespace espalier::dynamics

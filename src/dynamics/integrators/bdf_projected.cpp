// The nonlinear equations of a step next to a singular position of the mechanism, where two branches of the motion meet
// and the rank of Phi_q drops. At the distance s from it the constraints hardly hold the motion in some directions
// (weak ones): an error e of q gives errors |v| e / s of v and |v|^2 e / s^2 of a there. The reduced iteration feeds
// the latter back into q and v by h' a and h'^2 a, and so contracts with (h' |v| / s)^2 only. This iteration
//   - renews K in every pass,
//   - puts v on its level again after q has moved,
//   - gives q and v only that part of da that F asks for, K [da_t; .] = [-F; 0], not what the acceleration level asks
//   for;
// it has the same fixed point and contracts independently of s, as the state-space form does. Rounding of Phi remains
// in the weak directions, 1e-16 |v| / s^2 in v. It does no harm to the motion, which has no component there, but would
// upset the error test, so weak parts are taken out of the estimate while such points are in the history.
#include <algorithm>
#include <cmath>

#include "dynamics/integrators/bdf.hpp"

namespace espalier::dynamics {

namespace {
// Steps that begin with the projected iteration once it was needed: about as many as it takes to get away.
constexpr int kProjectedSteps = 3;
// A weak part of the last change above this many tolerances: the step ended too near to the singular position.
constexpr double kWeakLimit = 100;
}  // namespace

// dq_, dv_ := their parts tangential to the constraints, K [x; .] = [W d; 0].
void BdfIntegrator::remove_weak_parts() {
  const std::size_t n = theta_.size(), m = level_.size();
  if (m == 0) return;
  fill_zero(equations_.pool(), rhs_);
  KktSolver& kkt = equations_.kkt();
  const ConstSpan w = kkt.w_of_factor();
  add_transposed(kkt.w_pattern(), w, dq_, Span(rhs_).first(n));
  add_transposed(kkt.w_pattern(), w, dv_, Span(rhs_).subspan(n + m, n));
  equations_.solve(rhs_, 2);
  copy(equations_.pool(), Span(rhs_).first(n), dq_);
  copy(equations_.pool(), Span(rhs_).subspan(n + m, n), dv_);
}

// One pass; leaves the changes of q and v in dq_ and dv_.
void BdfIntegrator::iterate_projected(StepReport& report) {
  const double hp = formula_.hp;
  equations_.factorize(trial_.view(), {1, hp, hp * hp});
  factor_q_ = placed_q_ = trial_.q;
  equations_.evaluate_constraints(trial_.t, trial_.q, {});
  iterate_reduced(report);
}

BdfIntegrator::Outcome BdfIntegrator::solve_projected(StepReport& report) {
  if (projected_left_ == 0) projected_left_ = kProjectedSteps;
  formula_is_projected_ = true;
  factor_hp_ = formula_.hp;
  factor_fresh_ = rate_poor_ = true;
  equations_.evaluate_constraints(trial_.t, trial_.q, {});
  double previous = 0;
  for (int iteration = 1; iteration <= options_.max_newton; ++iteration) {
    try {
      iterate_projected(report);
    } catch (const Error& error) {  // the iterate hit the singular position itself
      if (error.status().code != StatusCode::singular) throw;
      return Outcome::diverged;
    }
    report.newton_iterations = iteration;
    const double whole = norm_of_change();
    if (!std::isfinite(whole)) return Outcome::diverged;
    remove_weak_parts();
    const double change = norm_of_change();
    if (previous > 0) report.newton_rate = change / previous;
    const double rate = iteration == 1 ? 0.5 : std::min(report.newton_rate, 0.9);
    const bool small = change * rate / (1 - rate) <= options_.newton_tolerance || change == 0;
    const bool stagnant = iteration >= 3 && change < 0.1 && report.newton_rate > 0.5;
    if ((small || stagnant) && finish_levels(report)) {
      return whole - change <= kWeakLimit ? Outcome::converged : Outcome::slow;
    }
    if (iteration > 3 && report.newton_rate > 2) return Outcome::diverged;
    previous = change;
  }
  return Outcome::slow;
}

}  // namespace espalier::dynamics

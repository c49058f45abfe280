// The nonlinear equations of a step by the reduced iteration.
#include <algorithm>
#include <cmath>

#include "dynamics/integrators/bdf.hpp"
#include "dynamics/integrators/newton_limits.hpp"

namespace espalier::dynamics {

// r1_ = T(theta) (theta - theta^)/h', the velocity that the formula gives.
void BdfIntegrator::rates_of_formula() {
  run(FormulaRates{1 / formula_.hp});
  velocity_of_rates();
}

// R1 = v - T(theta) (theta - theta^)/h' and R2 = a - (v - v^)/h'; theta_ must belong to s.
void BdfIntegrator::stage_residuals(const State& s) {
  const double inverse = 1 / formula_.hp;
  rates_of_formula();
  for_coordinates([&](std::size_t i) {
    r1_[i] = s.v[i] - r1_[i];
    r2_[i] = s.a[i] - (s.v[i] - v_hat_[i]) * inverse;
  });
}

// The first two solves of a pass: q, then v at the new q, onto their levels along the BDF formulas. One after the
// other, because the velocity level turns with q: with both at the old q the error of a pass is that of the one before
// times 2 |omega| h' (0.12 in the engine, nine passes where four do).
// @pre constraints evaluated at the trial position
void BdfIntegrator::project_stages() {
  const std::size_t m = level_.size();
  const double hp = formula_.hp, inverse = 1 / hp;
  rates_of_formula();
  equations_.set_slip(r1_, hp);
  run(StageChanges{hp, inverse});
  fetch_for_host({&MotionArrays::dq, &MotionArrays::dv});
  if (m > 0) add_normal_part(equations_.phi(), &MotionArrays::dq);
  move_position(&MotionArrays::dq);
  if (m > 0) {
    fetch_for_host({&MotionArrays::q});
    equations_.evaluate_constraints(trial_.t, trial_.q, {});
    equations_.level(trial_.v, equations_.nu(), level_);
    add_normal_part(level_, &MotionArrays::dv);
  }
  run(AddTo{&MotionArrays::v, &MotionArrays::dv});
  fetch_for_host({&MotionArrays::q, &MotionArrays::v});
}

// change += x, K [x; .] = [0; -violation - Phi_q,K change]: what the level lacks after the change, in normal
// directions.
// @pre a change on a GPU was seen
void BdfIntegrator::add_normal_part(ConstSpan violation, MotionVector change) {
  const MotionArrays here = arrays();
  const std::size_t n = theta_.size(), m = level_.size();
  const Span lower(here.normal + n, m);
  equations_.kkt().multiply_phi_q(ConstSpan(here.*change, n), lower);
  for (std::size_t i = 0; i < m; ++i) lower[i] = -violation[i] - lower[i];
  solve_normal();
  run(AddTo{change, &MotionArrays::normal});
}

// normal := K^-1 [0; r], where r are its last m numbers.
void BdfIntegrator::solve_normal() {
  const MotionArrays here = arrays();
  const std::size_t n = theta_.size(), m = level_.size();
  if (on_device()) {
    equations_.solve_normal_there(ConstSpan(here.normal + n, m), device_motion().arrays().normal);
    return vectors_.take_right_sides(here, {&MotionArrays::normal});
  }
  fill_zero(equations_.pool(), Span(here.normal, n));
  equations_.solve(Span(here.normal, n + m), 1, 1);
}

// What the formula's rate of the trial position slips where velocities alone are bound.
void BdfIntegrator::find_slip() {
  if (!equations_.has_non_holonomic()) return;
  rates_of_formula();
  equations_.set_slip(r1_, formula_.hp);
}

// One pass of the reduced iteration; leaves the changes of q, v and lambda in dq_, dv_ and level_. v and q get that
// part of da only that F asks for: what the acceleration level asks for is normal to the constraints and would take v
// and q off their levels.
void BdfIntegrator::iterate_reduced(StepReport& report) {
  const std::size_t n = theta_.size(), m = level_.size();
  const MotionArrays here = arrays();
  project_stages();
  equations_.evaluate_gamma(trial_.t, trial_.q, trial_.v);
  if (on_device())
    residual_there();
  else
    equations_.motion(trial_.view(), f_);
  equations_.level(trial_.a, equations_.gamma(), level_);
  const Span tangential(rhs_.data(), n + m), normal(rhs_.data() + n + m, n + m);
  if (!on_device())
    report.residual = largest_of(equations_.pool(), n, [&](std::size_t i) {
      RightSides{}(here, i);
      return f_[i];
    });
  for (std::size_t i = 0; i < m; ++i) {
    tangential[n + i] = 0;
    normal[n + i] = -level_[i];
  }
  const Index normal_columns = m > 0 ? 1 : 0;
  if (on_device())
    solve_there();
  else
    equations_.solve(m > 0 ? Span(rhs_) : tangential, 1 + normal_columns, normal_columns);
  run(PassChanges{formula_.hp});
  for (std::size_t i = 0; i < m; ++i) {
    level_[i] = tangential[n + i] + normal[n + i];
    trial_.lambda[i] += level_[i];
  }
  move_position(&MotionArrays::work);
  chart_of_position();
  fetch_for_host({&MotionArrays::q, &MotionArrays::v, &MotionArrays::a});
  // The levels at the new state: the next iteration starts from them, or the step ends with them.
  equations_.evaluate_constraints(trial_.t, trial_.q, trial_.v);
}

// Whether what a pass has changed of the multipliers leaves nothing: forces (Phi_q - Phi_q of the factor)^T change.
// Changes of q and v do not tell: errors of the multipliers hardly reach them, and each prediction, which goes on from
// three of them, makes these errors up to seven times as large. With an old factor, when bodies have turned since, one
// pass a step may take less away (a worm at 26 rad/s: from 1e-18 to 6e10 in 100 steps).
bool BdfIntegrator::multipliers_settle(const StepReport& report) {
  constexpr double kMost = 0.01;        // of the constraint forces of that coordinate ...
  constexpr double kLeast = 1e-3;       // ... or of this part of the largest,
  constexpr double kOfResidual = 1e-4;  // or of what the pass had to balance
  const SparsePattern& p = equations_.system().constraint_pattern();
  const ConstSpan now = equations_.phi_q(), factor = equations_.kkt().phi_q_values();
  std::fill(work_n_.begin(), work_n_.end(), 0.0);
  std::vector<double> forces(work_n_.size(), 0.0);
  double largest = 0;
  for (std::size_t i = 0; i < level_.size(); ++i) {
    for (auto k = at(p.ptr[i]); k < at(p.ptr[i + 1]); ++k) {
      const auto column = at(p.ind[k]);
      work_n_[column] += (now[k] - factor[k]) * level_[i];
      forces[column] += std::abs(now[k] * trial_.lambda[i]);
      largest = std::max(largest, forces[column]);
    }
  }
  for (std::size_t j = 0; j < forces.size(); ++j)
    if (std::abs(work_n_[j]) > std::max(kMost * std::max(forces[j], kLeast * largest), kOfResidual * report.residual))
      return false;
  return true;
}

bool BdfIntegrator::constraints_hold(StepReport& report) {
  report.levels.motion = report.residual;
  if (level_.empty()) return true;
  find_slip();
  report.levels.position = max_norm(equations_.phi());
  equations_.level(trial_.v, equations_.nu(), level_);
  report.levels.velocity = max_norm(level_);
  const double velocity = largest_level(level_);
  equations_.level(trial_.a, equations_.gamma(), level_);
  report.levels.acceleration = max_norm(level_);
  const double tolerance = options_.constraint_tolerance;
  if (!(largest_level(equations_.phi()) <= tolerance)) return false;
  if (!row_sizes_.empty()) return levels_of_motion_hold(velocity, largest_level(level_));
  const MotionRecord sizes =
      on_device() ? measure({.largest = {&MotionArrays::v, &MotionArrays::a}, .sums = {}})
                  : MotionRecord{{max_norm(equations_.pool(), trial_.v), max_norm(equations_.pool(), trial_.a)}, {}};
  return report.levels.velocity <= tolerance * std::max(1.0, sizes.largest[0]) &&
         report.levels.acceleration <= tolerance * std::max(1.0, sizes.largest[1]);
}

// As above, in units of the sizes: per unit of time, and of its square.
bool BdfIntegrator::levels_of_motion_hold(double velocity, double acceleration) {
  const ErrorBudget& budget = options_.budget;
  double v = 1 / budget.duration, a = v * v;
  if (on_device()) {
    const MotionRecord sizes = measure({.largest = {&MotionArrays::v, &MotionArrays::a}, .sums = {}});
    v = std::max(v, sizes.largest[0] / budget.extent);
    a = std::max(a, sizes.largest[1] / budget.extent);
  } else {
    v = std::max(
        v, largest_of(equations_.pool(), trial_.v.size(), [&](std::size_t i) { return trial_.v[i] / budget.size(i); }));
    a = std::max(
        a, largest_of(equations_.pool(), trial_.a.size(), [&](std::size_t i) { return trial_.a[i] / budget.size(i); }));
  }
  return velocity <= options_.constraint_tolerance * v && acceleration <= options_.constraint_tolerance * a;
}

// What is left of the violations once q and v are as good as the error test asks for: projections of q, v and a along
// W^-1 Phi_q^T, which the formulas leave free, one after the other, without F. They contract with the change of Phi_q
// since the factor alone, while whole passes contract with the error of W too (engine: 0.2, up to eight passes more).
bool BdfIntegrator::finish_levels(StepReport& report) {
  constexpr int kMostRounds = 4;
  const std::size_t n = theta_.size(), m = level_.size();
  const Span normal(arrays().normal, n + m), lower = normal.subspan(n);
  const auto solve_for = [&](ConstSpan violation) {
    std::transform(violation.begin(), violation.end(), lower.begin(), [](double x) { return -x; });
    solve_normal();
  };
  for (int round = 0; round < kMostRounds; ++round) {
    if (constraints_hold(report)) return true;
    if (largest_level(equations_.phi()) > options_.constraint_tolerance) {
      solve_for(equations_.phi());
      move_position(&MotionArrays::normal);
      fetch_for_host({&MotionArrays::q});
      equations_.evaluate_constraints(trial_.t, trial_.q, {});
    }
    equations_.level(trial_.v, equations_.nu(), level_);
    solve_for(level_);
    run(AddTo{&MotionArrays::v, &MotionArrays::normal});
    fetch_for_host({&MotionArrays::v});
    equations_.evaluate_gamma(trial_.t, trial_.q, trial_.v);
    equations_.level(trial_.a, equations_.gamma(), level_);
    solve_for(level_);
    run(AddTo{&MotionArrays::a, &MotionArrays::normal});
    fetch_for_host({&MotionArrays::a});
    for (std::size_t i = 0; i < m; ++i) trial_.lambda[i] += lower[i];
    chart_of_position();
  }
  return constraints_hold(report);
}

// True if even the passes that are left will not do at this rate.
bool BdfIntegrator::hopeless(double change, double rate, int iteration) const {
  return rate >= 1 || change * std::pow(rate, options_.max_newton - iteration) > options_.newton_tolerance;
}

// Rounding of v where all are as large as the largest, in units of the tolerance, but at most half of it: passes cannot
// agree better at tolerances like 1e-13 (Andrews' mechanism: 0.1 to 0.4).
double BdfIntegrator::rounding_of_change() {
  if (on_device()) {
    const MotionRecord record = measure({.largest = {&MotionArrays::v}, .sums = {{&MotionArrays::weight_v}}});
    const double unit = std::numeric_limits<double>::epsilon() * record.largest[0];
    return std::min(0.5, unit / share_v_ * std::sqrt(record.sum[0] / static_cast<double>(weight_v_.size())));
  }
  const double eps = std::numeric_limits<double>::epsilon() * max_norm(equations_.pool(), trial_.v);
  const double sum = sum_of(equations_.pool(), weight_v_.size(),
                            [&](std::size_t i) { return eps * eps * weight_v_[i] * weight_v_[i]; });
  return std::min(0.5, std::sqrt(sum / static_cast<double>(weight_v_.size())) / share_v_);
}

// The step is shorter than the tolerance asks for: the run wants more of it than the tolerance says.
bool BdfIntegrator::step_is_held() const {
  return options_.fixed_step > 0 || formula_.h >= (1 - 1e-9) * options_.max_step;
}

// False where as many constraints as velocities say all of the motion.
bool BdfIntegrator::has_freedom() const {
  const std::size_t n = theta_.size(), m = level_.size();
  if (m < n) return true;
  const auto& dropped = equations_.dropped();
  return m - static_cast<std::size_t>(std::count_if(dropped.begin(), dropped.end(), [](char d) { return d != 0; })) < n;
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
double BdfIntegrator::change_of_pass(StepReport& report) {
  struct PassChange {
    LargestValue dq, dv, a;
    double square_q = 0, square_v = 0;
  };
  if (on_device()) {
    const MotionRecord record =
        measure({.largest = {&MotionArrays::dq, &MotionArrays::dv, &MotionArrays::a, &MotionArrays::f},
                 .sums = {{&MotionArrays::dq, &MotionArrays::weight_q}, {&MotionArrays::dv, &MotionArrays::weight_v}}});
    report.residual = record.largest[3];
    return change_of({record.largest[0], record.largest[1], record.largest[2], record.sum[0], record.sum[1]});
  }
  const PassChange all = reduce_blocks<PassChange>(
      equations_.pool(), dq_.size(),
      [&](std::size_t begin, std::size_t end) {
        PassChange part;
        for (std::size_t i = begin; i < end; ++i) {
          part.dq.include(dq_[i]);
          part.dv.include(dv_[i]);
          part.a.include(trial_.a[i]);
        }
        part.square_q =
            sum_in_order(begin, end, [&](std::size_t i) { return dq_[i] * dq_[i] * weight_q_[i] * weight_q_[i]; });
        part.square_v =
            sum_in_order(begin, end, [&](std::size_t i) { return dv_[i] * dv_[i] * weight_v_[i] * weight_v_[i]; });
        return part;
      },
      [](PassChange& sum, const PassChange& next) {
        sum.dq.include(next.dq);
        sum.dv.include(next.dv);
        sum.a.include(next.a);
        sum.square_q += next.square_q;
        sum.square_v += next.square_v;
      });
  return change_of({all.dq.value(), all.dv.value(), all.a.value(), all.square_q, all.square_v});
}

double BdfIntegrator::change_of(const Change& all) {
  const double dv = formula_.hp * all.dv, a = formula_.hp * formula_.hp * all.a;
  tiny_ = std::max(all.dq, dv) <= kRounding * size_q_;
  level_of_a_ = a > 0 ? dv / a : 0;
  if (dq_.empty()) return 0;
  const double of_q = all.square_q / (share_q_ * share_q_), of_v = all.square_v / (newton_share_v_ * newton_share_v_);
  return std::sqrt(std::max(of_q, of_v) / static_cast<double>(dq_.size()));
}

BdfIntegrator::Outcome BdfIntegrator::solve_reduced(StepReport& report) {
  formula_is_projected_ = false;
  equations_.evaluate_constraints(trial_.t, trial_.q, {});
  double previous = 0, first = 0;
  int renewed = 0;
  constexpr int kMostForMultipliers = 4;
  const double rate_before = rate_;
  const bool held = step_is_held();
  report.newton_rate = report.rounding = 0;
  for (int iteration = 1; iteration <= options_.max_newton; ++iteration) {
    iterate_reduced(report);
    const double change = change_of_pass(report);
    const bool settled = level_.empty() || multipliers_settle(report);
    report.newton_iterations = iteration;
    if (!std::isfinite(change)) return Outcome::diverged;
    if (iteration == 1) first = change;
    if (previous > 0) {
      report.newton_rate = change / previous;
      rate_ = std::max(0.3 * rate_, report.newton_rate);
    }
    const double rate = std::min(rate_, 0.9);
    // One pass tells nothing of the rate, and a step held short wants to know. Nor do changes of q and v tell of the
    // multipliers where constraints say all of the motion: a second pass finds those that the equations ask for.
    const bool known = iteration > 1 || !held;
    const bool multipliers_known = (settled && (iteration > 1 || has_freedom())) || iteration >= kMostForMultipliers;
    const bool small = multipliers_known && ((known && change * rate / (1 - rate) <= allowed_change()) || change == 0);
    const bool at_floor = !small && previous > 0 && rounding_ends(change, report);
    if ((small || at_floor) && finish_levels(report)) {
      rate_poor_ = !settled || (small && report.newton_rate > options_.refactor_rate && change > 1e-9);
      if (at_floor && held) rate_ = rate_before, report.rounding = level_of_a_;
      own_error_ = std::max(latest_error_, kMemory * own_error_);
      return Outcome::converged;
    }
    if (!settled && !factor_fresh_ && iteration > 1) return Outcome::slow;
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
  return options_.iteration == DaeIteration::reduced ? solve_reduced(report) : solve_full(report);
}

}  // namespace espalier::dynamics

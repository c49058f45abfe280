// What generalized-alpha carries from step to step belongs to the length of the steps.
//
// In a smooth motion a_n is not v' at t_n but at t_n + (alpha_m - alpha_f) h, and in the directions that constraints
// hold, where q is exact, v_n is off by
//     d(h) = (gamma / 2 - beta - 1/12) h^2 v'' + h/6 (T(-h v)^-1 v' - v'),      v'' = dv'/dt,
// the last term on groups only: both follow from the formulas of q and v with h v + h^2/2 v' + h^3/6 (v'' - [v, v']/2)
// for the true increment of q (Magnus, in axes that do not turn) on their left side. A start with d = 0, and a step of
// another length, are thus off by order h^2 in v and by order h in v' and lambda, which then swing and fade with
// spectral_radius^n, or never with 1 (Arnold, Bruels, Cardona, Numer. Math. 129, 2015, who perturb the initial values).
// Here v and a_n are moved by the difference of the two lengths, v in normal directions only; at the start v'' comes
// from the first step itself, which is taken again until it agrees with its own v''.
#include <algorithm>
#include <cmath>

#include "dynamics/integrators/generalized_alpha.hpp"

namespace espalier::dynamics {

namespace {
// The first step is taken again at most so often; v'' converges by 0.35 (spectral radius 0.8 to 1) to 0.67 (0).
constexpr int kMostSweeps = 10;
constexpr double kSettled = 1e-3;
// A step shorter than this share of the last one, or of the very first, leaves errors in v' and lambda that swing: 5 %
// of a hinge's force after a thousandth of a step (pendulum, radius 0.8), no convergence any more after 1e-4.
constexpr double kSliver = 1e-2, kFirstSliver = 1e-4;
}  // namespace

// out += sign d(h)
void GeneralizedAlpha::add_offset(double h, double sign, Span out) const {
  if (h == 0) return;
  std::vector<double> theta(out.size()), turned(out.size());
  for_coordinates([&](std::size_t i) { theta[i] = -h * state_.v[i]; });
  equations_.system().rate_of_velocity(theta, state_.a, turned);
  const double c = gamma_ / 2 - beta_ - 1.0 / 12;
  for_coordinates([&](std::size_t i) { out[i] += sign * (c * h * h * jerk_[i] + h / 6 * (turned[i] - state_.a[i])); });
}

// Whether a step of length h asks for more than what the one before has left.
bool GeneralizedAlpha::changes_length(double h) const { return jerk_known_ && std::abs(h - fitted_) > 1e-6 * h; }

// a_from_ and v_from_ for a step of length h.
void GeneralizedAlpha::fit(double h) {
  run(CopyOf{&MotionArrays::a_from, &MotionArrays::a_old});
  run(CopyOf{&MotionArrays::v_from, &MotionArrays::v_start});
  if (!changes_length(h)) return;
  const std::size_t n = a_from_.size(), m = state_.lambda.size();
  for_coordinates([&](std::size_t i) { a_from_[i] += (alpha_m_ - alpha_f_) * (h - fitted_) * jerk_[i]; });
  if (m == 0 || factor_c_q_ == 0) return;
  // v_from_ += x, K [x; .] = [0; Phi_q (d(h) - d(fitted))]
  fill_zero(equations_.pool(), work_);
  add_offset(h, 1, work_);
  add_offset(fitted_, -1, work_);
  equations_.evaluate_constraints(state_.t, state_.q, {});
  fill_zero(equations_.pool(), rhs_);
  equations_.level(work_, {}, Span(rhs_).subspan(n));
  for (const Index row : equations_.system().non_holonomic()) rhs_[n + at(row)] = 0;  // exact
  equations_.solve(rhs_, 1, 1);
  for_coordinates([&](std::size_t i) { v_from_[i] += rhs_[i]; });
}

bool GeneralizedAlpha::sliver(double t_limit) const {
  const double shortest = fitted_ > 0 ? kSliver * fitted_ : kFirstSliver * options_.step;
  return t_limit - state_.t + drifted_ <= shortest;
}

// Where two callers' sums of steps differ by rounding, say. v and the configuration go on by Taylor's formula, which
// leaves h^3 v''/6, far below the errors of the method; v' by what is known of v''. What the method remembers stays.
// Forces that change meanwhile are heard of at its next step.
void GeneralizedAlpha::drift(double t) {
  const double h = t - state_.t;
  const std::size_t n = a_old_.size();
  vectors_.leave();
  trial_ = state_;
  for (std::size_t i = 0; i < n; ++i) {
    delta_[i] = h * (state_.v[i] + 0.5 * h * state_.a[i]);
    trial_.v[i] += h * state_.a[i];
  }
  equations_.system().retract(state_.q, delta_, trial_.q);
  for (std::size_t i = 0; i < n && jerk_known_; ++i) {
    trial_.a[i] += h * jerk_[i];
    a_old_[i] += h * jerk_[i];
  }
  carry({trial_.v, trial_.a, a_old_, jerk_, a_before_});
  trial_.t = t;
  std::swap(state_, trial_);
  equations_.system().accept(state_.view());
  drifted_ += h;
}

// v'' over the last two steps: what swings from step to step, (-spectral_radius)^n, hardly shows there. Over one step
// it would feed itself where lengths change often (a pendulum whose steps double and halve in turn: 1e13 times its
// multiplier after 60 steps, where two steps keep order 2).
void GeneralizedAlpha::learn_jerk() {
  const bool two = h_before_ > 0;
  const std::vector<double>& before = two ? a_before_ : state_.a;
  const double time = two ? h_ + h_before_ : h_;
  for_coordinates([&](std::size_t i) { jerk_[i] = (a_step_[i] - before[i]) / time; });
  jerk_known_ = true;
}

// Takes the first step again with what it says of v'' itself, until both agree. Where they do not come together (a load
// that begins with a jolt, stiff modes that the step does not resolve) the start stays as it was given.
// @return false if Newton failed on the way
bool GeneralizedAlpha::settle(StepReport& report) {
  if (fitted_ > 0 || plain_start_) return true;
  double last = 0;
  for (int sweep = 0; sweep < kMostSweeps; ++sweep) {
    for_coordinates([&](std::size_t i) { work_[i] = (a_step_[i] - state_.a[i]) / h_; });
    const double size = scaled_norm(work_, {});
    for_coordinates([&](std::size_t i) {
      std::swap(work_[i], jerk_[i]);
      if (sweep > 0) work_[i] -= jerk_[i];
    });
    const double change = sweep > 0 ? scaled_norm(work_, {}) : size;
    if (change <= kSettled * size) return true;
    plain_start_ = sweep > 0 && change > 0.9 * last;
    jerk_known_ = !plain_start_;
    last = change;
    const bool good = attempt(h_, false, report);
    if (!good) {
      plain_start_ = true;
      jerk_known_ = false;
    }
    if (plain_start_) return good;
  }
  return true;
}

}  // namespace espalier::dynamics

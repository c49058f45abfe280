// The vectors of generalized-alpha on the GPU that has the factor and the flexible bodies. They go there at the
// beginning of a step and stay; the host keeps those numbers of them that its joints and forces look at, and gets the
// state and what the method remembers once a step. So it can go on from there at any time: with the first step, steps
// of a new length and those that may search, which are always its own, and where the GPU has failed.
#include <algorithm>

#include "base/at.hpp"
#include "dynamics/integrators/generalized_alpha.hpp"

namespace espalier::dynamics {

// The arrays of the host.
MotionArrays GeneralizedAlpha::arrays() {
  MotionArrays s;
  s.v = trial_.v.data();
  s.a = trial_.a.data();
  s.f = f_.data();
  s.work = work_.data();
  s.v_start = state_.v.data();
  s.a_start = state_.a.data();
  s.a_before = a_before_.data();
  s.a_old = a_old_.data();
  s.a_from = a_from_.data();
  s.v_from = v_from_.data();
  s.a_base = a_base_.data();
  s.v_base = v_base_.data();
  s.delta_base = delta_base_.data();
  s.delta = delta_.data();
  s.a_step = a_step_.data();
  s.weight = weight_.data();
  s.force = force_.data();
  s.second = second_.data();
  s.change = rhs_.data();
  s.scale = equations_.kkt().scale().data();
  return s;
}

// Chooses the place of an attempt with a step of length h.
void GeneralizedAlpha::choose_place(double h) {
  const bool goes_on = fitted_ > 0 && !changes_length(h) && !options_.search && !equations_.has_non_holonomic();
  if (vectors_.lost() || !goes_on || !equations_.kkt().solves_there()) vectors_.leave();
  if (!on_device() && goes_on && equations_.kkt().solves_there()) enter_device();
}

void GeneralizedAlpha::enter_device() {
  // From the first vector on, attempt() gets the host back where the GPU fails.
  if (!vectors_.enter({kAlphaVectors, kAlphaRightSides})) return;
  equations_.system().magnitude(state_.q, work_);
  for_coordinates([&](std::size_t i) { weight_[i] = weight_of(work_[i]); });
  size_q_there_ = vectors_.largest_of_bodies(work_);
  constexpr MotionVector kSent[] = {&MotionArrays::v_start, &MotionArrays::a_start, &MotionArrays::a_before,
                                    &MotionArrays::a_old, &MotionArrays::weight};
  vectors_.send(arrays(), kSent);
  vectors_.send_position(state_.q, vectors_.device_motion().arrays().q_start);
  vectors_.device_motion().use_scale(equations_.kkt().scale_there());
}

// The rest of reach().
void GeneralizedAlpha::reach_there() {
  vectors_.device_motion().run(PositionReached{});
  for (const OwnCoordinates& c : vectors_.share().owners) c.retract(state_.q, delta_, trial_.q);
  carry({trial_.a, trial_.v});
  vectors_.fetch_for_host(arrays(), trial_, {&MotionArrays::q, &MotionArrays::v, &MotionArrays::a});
}

// Bodies have the weights that went there with them.
void GeneralizedAlpha::weigh_there() {
  for (const OwnCoordinates& c : vectors_.share().owners) c.magnitude(state_.q, weight_);
  size_q_ = std::max(size_q_there_, measure({.largest = {&MotionArrays::delta}, .sums = {}}).largest[0]);
  for (const Index i : vectors_.share().own) {
    size_q_ = std::max(size_q_, weight_[at(i)]);
    weight_[at(i)] = weight_of(weight_[at(i)]);
  }
}

// F + Phi_q^T lambda, and what follows from it; take_change_there() says how large it is.
void GeneralizedAlpha::find_forces_there() {
  equations_.motion_there(trial_.view(), vectors_.state(trial_), f_, vectors_.device_motion().arrays().f);
  run(ForcesOfPass{});
}

// @pre the lower part of the right-hand side
void GeneralizedAlpha::solve_there() {
  vectors_.put_right_side(arrays(), &MotionArrays::change);
  equations_.solve_there(vectors_.device_motion().arrays().change);
  vectors_.take_right_sides(arrays(), {&MotionArrays::change});
}

// @return the sum of (da weight)^2
double GeneralizedAlpha::take_change_there(Change& change, StepReport& report) {
  const std::size_t n = delta_.size();
  run(ScaledChange{});
  const Span da(rhs_.data(), n), dlambda = Span(rhs_).subspan(n);
  for (const OwnCoordinates& c : vectors_.share().owners) c.rate_of_velocity(delta_, da, da);
  run(ChangedAcceleration{h_before_ > 0 ? h_ / h_before_ : 0.0});
  const MotionRecord record = measure({.largest = {&MotionArrays::force, &MotionArrays::f, &MotionArrays::work,
                                                   &MotionArrays::change, &MotionArrays::second},
                                       .sums = {{&MotionArrays::change, &MotionArrays::weight}}});
  change.force = record.largest[0];
  report.residual = record.largest[1];
  change.scaled = scaled_multipliers(dlambda, record.largest[2]);
  change.q = c_q_ * record.largest[3];
  change.second = record.largest[4];
  return record.sum[0];
}

// Ends the device's part of a step that is going to be accepted: all that the host needs to go on by itself comes
// first. What accept() does with that for the host, NextStep does there.
void GeneralizedAlpha::end_step_there() {
  const MotionArrays& s = vectors_.device_motion().arrays();
  vectors_.fetch_state(trial_);
  vectors_.fetch(s.a_base, a_base_);
  vectors_.fetch(s.a_step, a_step_);
  run(LastChanges{});
  const MotionRecord record = measure({.largest = {},
                                       .sums = {{&MotionArrays::second, &MotionArrays::weight, &MotionArrays::work},
                                                {&MotionArrays::second, &MotionArrays::weight}}});
  set_trend(record.sum[0], record.sum[1]);
  vectors_.device_motion().run(NextStep{(1 - alpha_f_) / (1 - alpha_m_)});
}

}  // namespace espalier::dynamics

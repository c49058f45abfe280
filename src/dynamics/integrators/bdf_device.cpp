// The vectors of BDF on the GPU that has the factor and the flexible bodies. They go there after a factorization and
// stay; the host keeps those numbers of them that its joints, forces and bodies look at, and gets the whole state once
// a step. Where a step needs more than the reduced iteration (a factor that is turned, a singular position), or the GPU
// has gone, they are the host's again.
#include <algorithm>

#include "dynamics/integrators/bdf.hpp"

namespace espalier::dynamics {

static_assert(kMotionPoints == History::kDepth);

// The arrays of the host.
MotionArrays BdfIntegrator::arrays() {
  MotionArrays s;
  s.v = trial_.v.data();
  s.a = trial_.a.data();
  s.theta = theta_.data();
  s.theta_hat = theta_hat_.data();
  s.v_hat = v_hat_.data();
  s.weight_q = weight_q_.data();
  s.weight_v = weight_v_.data();
  s.rate = r1_.data();
  s.dq = dq_.data();
  s.dv = dv_.data();
  s.f = f_.data();
  s.work = work_n_.data();
  s.tangential = rhs_.data();
  s.normal = rhs_.data() + theta_.size() + level_.size();
  for (int j = 0; j < history_.size(); ++j) {
    s.past_v[j] = history_.v(j).data();
    s.past_theta[j] = history_.theta(j).data();
  }
  return s;
}

// Asked at an attempt that has its factor: only the reduced iteration is there.
bool BdfIntegrator::may_enter_device() const {
  return !on_device() && !equations_.has_non_holonomic() && options_.iteration == DaeIteration::reduced &&
         !options_.measure_blocks && projected_left_ == 0 && noisy_left_ == 0 && first_left_ == 0 &&
         equations_.kkt().solves_there();
}

void BdfIntegrator::enter_device() {
  // From the first vector on, attempt() gets the host back where the GPU fails.
  if (!vectors_.enter({kBdfVectors, kBdfRightSides, history_.depth()})) return;
  constexpr MotionVector kSent[] = {&MotionArrays::v,         &MotionArrays::a,     &MotionArrays::theta,
                                    &MotionArrays::theta_hat, &MotionArrays::v_hat, &MotionArrays::weight_q,
                                    &MotionArrays::weight_v};
  vectors_.send(arrays(), kSent);
  const MotionArrays& s = device_motion().arrays();
  vectors_.send_position(trial_.q, s.q);
  vectors_.send_position(placed_q_, s.placed_q);
  for (int j = 0; j < history_.size(); ++j) {
    vectors_.send_position(history_.q(j), s.past_q[j]);
    device_motion().send(history_.v(j), s.past_v[j]);
    device_motion().send(history_.theta(j), s.past_theta[j]);
  }
  equations_.system().magnitude(state_.q, work_n_);
  size_q_there_ = vectors_.largest_of_bodies(work_n_);
}

// The trial state is lost; the attempt has to begin anew. Nothing happens on the host.
void BdfIntegrator::leave_device() {
  if (!on_device()) return;
  if (const DeviceMotion* const motion = vectors_.memory(); motion != nullptr && factor_hp_ > 0) {
    try {
      vectors_.fetch_position(motion->arrays().placed_q, placed_q_);
      factor_q_ = placed_q_;
    } catch (const Error&) {  // a GPU that has failed
      factor_hp_ = 0;
    }
  }
  vectors_.leave();
  history_.renew_charts(equations_.pool());
  error_weights();
}

// After an error of the GPU.
void BdfIntegrator::continue_on_host(const Error& error) {
  leave_device();
  vectors_.give_up(error);
  factor_hp_ = 0;
}

// What History::push() does. The step is the host's already.
void BdfIntegrator::push_there(bool in_place_of_newest) {
  try {
    if (!in_place_of_newest) device_motion().turn_past();
    device_motion().run(NewPoint{history_.size()});
  } catch (const Error& error) {
    if (!vectors_.host_can_continue(error)) throw;
    continue_on_host(error);
  }
}

void BdfIntegrator::error_weights_there() {
  // The weights of a budget stay as they were sent.
  if (!options_.budget.given()) device_motion().run(VelocityWeights{options_.relative, options_.absolute_velocity});
  for (const OwnCoordinates& c : share().owners) c.magnitude(state_.q, weight_q_);
  size_q_ = size_q_there_;
  for (const Index k : share().own) {
    const auto i = at(k);
    const double size = weight_q_[i];
    size_q_ = std::max(size_q_, size);
    weight_q_[i] = 1 / tolerance_of_position(i, size);
    weight_v_[i] = 1 / tolerance_of_velocity(i);
  }
}

void BdfIntegrator::place_factor_there() {
  device_motion().run(CopyOf{&MotionArrays::placed_q, &MotionArrays::q});
  for (const OwnCoordinates& c : share().owners) {
    const auto first = static_cast<std::ptrdiff_t>(c.q());
    std::copy_n(trial_.q.begin() + first, c.component().sizes().configuration, placed_q_.begin() + first);
  }
}

void BdfIntegrator::predict_position() {
  if (!on_device()) return equations_.system().retract(history_.q(0), theta_, trial_.q);
  device_motion().run(PositionInChart{});
  for (const OwnCoordinates& c : share().owners) c.retract(history_.q(0), theta_, trial_.q);
}

// q := q (+) change
void BdfIntegrator::move_position(MotionVector change) {
  const ConstSpan here(arrays().*change, theta_.size());
  if (!on_device()) return equations_.system().retract(trial_.q, here, trial_.q);
  device_motion().run(AddTo{&MotionArrays::q, change});
  for (const OwnCoordinates& c : share().owners) c.retract(trial_.q, here, trial_.q);
}

// theta := the chart's coordinates of q
void BdfIntegrator::chart_of_position() {
  if (!on_device()) return equations_.system().local(history_.q(0), trial_.q, theta_);
  device_motion().run(ChartOfPosition{});
  for (const OwnCoordinates& c : share().owners) c.local(history_.q(0), trial_.q, theta_);
}

// r1_ := the velocities that belong to these rates of theta
void BdfIntegrator::velocity_of_rates() {
  if (!on_device()) return equations_.system().velocity_of_rate(theta_, r1_, r1_);
  for (const OwnCoordinates& c : share().owners) c.velocity_of_rate(theta_, r1_, r1_);
}

// F + Phi_q^T lambda, and -F in the first right-hand side.
void BdfIntegrator::residual_there() {
  equations_.motion_there(trial_.view(), vectors_.state(trial_), f_, device_motion().arrays().f);
  run(RightSides{});
}

// Both solves of a pass. @pre the lower parts of both right-hand sides
void BdfIntegrator::solve_there() {
  const MotionArrays here = arrays(), &s = device_motion().arrays();
  const std::size_t n = theta_.size(), m = level_.size();
  vectors_.put_right_side(here, &MotionArrays::tangential);
  equations_.solve_there(s.tangential);
  if (m > 0) equations_.solve_normal_there(ConstSpan(here.normal + n, m), s.normal);
  vectors_.take_right_sides(here, {&MotionArrays::tangential, &MotionArrays::normal});
}

}  // namespace espalier::dynamics

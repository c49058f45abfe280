// The vectors of BDF on the GPU that has the factor and the flexible bodies. They go there after a factorization and
// stay; the host keeps those numbers of them that its joints, forces and bodies look at, and gets the whole state once
// a step. Where a step needs more than the reduced iteration (a factor that is turned, a singular position), or the GPU
// has gone, they are the host's again.
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "dynamics/integrators/bdf.hpp"

namespace espalier::dynamics {

static_assert(kBdfPoints == History::kDepth);

// Those of the host.
BdfArrays BdfIntegrator::arrays() {
  BdfArrays s;
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

StateView BdfIntegrator::state_there() const {
  const BdfArrays& s = there().arrays();
  const std::size_t n = theta_.size();
  return {trial_.t, ConstSpan(s.q, n), ConstSpan(s.v, n), ConstSpan(s.a, n), trial_.lambda};
}

// Brings what the host looks at.
void BdfIntegrator::see(std::initializer_list<BdfVector> vectors) {
  if (!on_device_) return;
  const BdfArrays here = arrays();
  const DeviceShare& shared = share();
  std::vector<const double*> from;
  for (const BdfVector vector : vectors) from.push_back(there().arrays().*vector);
  ConstSpan values = there().look(DeviceMotion::List::seen, from);
  for (const BdfVector vector : vectors) {
    const bool is_q = vector == &BdfArrays::q;
    double* const to = is_q ? trial_.q.data() : here.*vector;
    const std::vector<Index>& places = is_q ? shared.seen_q : shared.seen;
    for (std::size_t k = 0; k < places.size(); ++k) to[static_cast<std::size_t>(places[k])] = values[k];
    values = values.subspan(places.size());
  }
}

// Brings the host's coordinates and multipliers of solutions.
void BdfIntegrator::take_right_sides(std::initializer_list<BdfVector> vectors) {
  const BdfArrays here = arrays();
  const std::vector<Index>& own = share().own;
  const std::size_t n = theta_.size(), m = level_.size();
  std::vector<const double*> from;
  for (const BdfVector vector : vectors) from.push_back(there().arrays().*vector);
  ConstSpan values = there().look(DeviceMotion::List::right_side, from);
  for (const BdfVector vector : vectors) {
    double* const to = here.*vector;
    for (std::size_t k = 0; k < own.size(); ++k) to[static_cast<std::size_t>(own[k])] = values[k];
    std::copy_n(values.begin() + static_cast<std::ptrdiff_t>(own.size()), m, to + n);
    values = values.subspan(own.size() + m);
  }
}

BdfRecord BdfIntegrator::measure(const BdfMeasure& what) {
  BdfRecord record = there().measure(what);
  const BdfArrays here = arrays();
  for (const Index i : share().own) what.add(here, static_cast<std::size_t>(i), record);
  return record;
}

// Of an attempt that has its factor: only the reduced iteration is there.
bool BdfIntegrator::may_enter_device() const {
  return !on_device_ && options_.iteration == BdfIteration::reduced && !options_.measure_blocks &&
         projected_left_ == 0 && noisy_left_ == 0 && first_left_ == 0 && equations_.kkt().solves_there();
}

void BdfIntegrator::enter_device() {
  DeviceMotion* const motion = equations_.claim_motion(history_.depth(), ticket_);
  if (motion == nullptr) return;
  on_device_ = true;  // from the first vector on: attempt() gets the host back where the GPU fails
  const BdfArrays here = arrays(), &s = motion->arrays();
  const std::size_t n = theta_.size();
  for (const BdfVector vector : {&BdfArrays::v, &BdfArrays::a, &BdfArrays::theta, &BdfArrays::theta_hat,
                                 &BdfArrays::v_hat, &BdfArrays::weight_q, &BdfArrays::weight_v})
    motion->send(ConstSpan(here.*vector, n), s.*vector);
  equations_.system().magnitude(state_.q, work_n_);
  size_q_there_ = 0;
  for (const DeviceShare::Range& r : share().ranges) {
    const auto v = static_cast<std::size_t>(r.v), q = static_cast<std::size_t>(r.q),
               count = static_cast<std::size_t>(r.count);
    const auto send = [&](ConstSpan from, double* to) { motion->send(from.subspan(q, count), to + v); };
    send(trial_.q, s.q);
    send(placed_q_, s.placed_q);
    for (int j = 0; j < history_.size(); ++j) send(history_.q(j), s.past_q[j]);
    size_q_there_ = std::max(size_q_there_, max_norm(equations_.pool(), ConstSpan(work_n_).subspan(v, count)));
  }
  for (int j = 0; j < history_.size(); ++j) {
    motion->send(history_.v(j), s.past_v[j]);
    motion->send(history_.theta(j), s.past_theta[j]);
  }
}

// The trial state is lost; the attempt has to begin anew. Nothing happens on the host.
void BdfIntegrator::leave_device() {
  if (!on_device_) return;
  if (DeviceMotion* const motion = equations_.motion_of(ticket_); motion != nullptr && factor_hp_ > 0) {
    try {
      for (const DeviceShare::Range& r : share().ranges)
        motion->fetch(motion->arrays().placed_q + r.v,
                      Span(placed_q_).subspan(static_cast<std::size_t>(r.q), static_cast<std::size_t>(r.count)));
      factor_q_ = placed_q_;
    } catch (const Error&) {  // a GPU that has failed
      factor_hp_ = 0;
    }
  }
  on_device_ = false;
  history_.renew_charts(equations_.pool());
  error_weights();
}

void BdfIntegrator::fetch_trial() {
  if (!on_device_) return;
  const BdfArrays& s = there().arrays();
  for (const DeviceShare::Range& r : share().ranges) {
    const auto part = [&](std::vector<double>& x, Index first) {
      return Span(x).subspan(static_cast<std::size_t>(first), static_cast<std::size_t>(r.count));
    };
    there().fetch(s.q + r.v, part(trial_.q, r.q));
    there().fetch(s.v + r.v, part(trial_.v, r.v));
    there().fetch(s.a + r.v, part(trial_.a, r.v));
  }
}

// What History::push() does.
void BdfIntegrator::push_there(bool in_place_of_newest) {
  if (!in_place_of_newest) there().turn_past();
  there().run(NewPoint{history_.size()});
}

void BdfIntegrator::error_weights_there() {
  there().run(VelocityWeights{options_.relative, options_.absolute_velocity});
  for (const Component* c : share().owners) c->magnitude(state_.q, weight_q_);
  size_q_ = size_q_there_;
  for (const Index k : share().own) {
    const auto i = static_cast<std::size_t>(k);
    const double size = weight_q_[i];
    size_q_ = std::max(size_q_, size);
    weight_q_[i] = 1 / (options_.relative * size + options_.absolute);
    weight_v_[i] = 1 / (options_.relative * std::abs(state_.v[i]) + options_.absolute_velocity);
  }
}

void BdfIntegrator::place_factor_there() {
  there().run(CopyOf{&BdfArrays::placed_q, &BdfArrays::q});
  for (const Component* c : share().owners)
    std::copy_n(trial_.q.begin() + c->placement().q, c->sizes().configuration, placed_q_.begin() + c->placement().q);
}

void BdfIntegrator::predict_position() {
  if (!on_device_) return equations_.system().retract(history_.q(0), theta_, trial_.q);
  there().run(PositionInChart{});
  for (const Component* c : share().owners) c->retract(history_.q(0), theta_, trial_.q);
}

// q := q (+) change
void BdfIntegrator::move_position(BdfVector change) {
  const ConstSpan here(arrays().*change, theta_.size());
  if (!on_device_) return equations_.system().retract(trial_.q, here, trial_.q);
  there().run(AddTo{&BdfArrays::q, change});
  for (const Component* c : share().owners) c->retract(trial_.q, here, trial_.q);
}

// theta := the chart's coordinates of q
void BdfIntegrator::chart_of_position() {
  if (!on_device_) return equations_.system().local(history_.q(0), trial_.q, theta_);
  there().run(ChartOfPosition{});
  for (const Component* c : share().owners) c->local(history_.q(0), trial_.q, theta_);
}

// r1_ := the velocities that belong to these rates of theta
void BdfIntegrator::velocity_of_rates() {
  if (!on_device_) return equations_.system().velocity_of_rate(theta_, r1_, r1_);
  for (const Component* c : share().owners) c->velocity_of_rate(theta_, r1_, r1_);
}

// F + Phi_q^T lambda, and -F in the first right-hand side.
void BdfIntegrator::residual_there() {
  equations_.motion_there(trial_.view(), state_there(), f_, there().arrays().f);
  run(RightSides{});
}

// Both solves of a pass. @pre the lower parts of both right-hand sides
void BdfIntegrator::solve_there() {
  const BdfArrays here = arrays(), &s = there().arrays();
  const std::size_t n = theta_.size(), m = level_.size();
  std::vector<double> values;
  for (const Index i : share().own) values.push_back(here.tangential[i]);
  values.resize(values.size() + m, 0.0);
  there().set(DeviceMotion::List::right_side, values, s.tangential);
  equations_.solve_there(s.tangential);
  if (m > 0) equations_.solve_normal_there(ConstSpan(here.normal + n, m), s.normal);
  take_right_sides({&BdfArrays::tangential, &BdfArrays::normal});
}

}  // namespace espalier::dynamics

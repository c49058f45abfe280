#include "dynamics/model/derivatives/motion_adjoint.hpp"

#include <algorithm>
#include <deque>
#include <utility>

#include "base/stage.hpp"
#include "dynamics/integrators/history.hpp"
#include "dynamics/integrators/linearised.hpp"

namespace espalier::dynamics::model {

namespace {

constexpr std::size_t kDefects = 8;  // steps at which the equations are compared with differences

double dot(const std::vector<double>& a, ConstSpan b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

}  // namespace

void MotionRecord::add(const State& state, int order) {
  Point point{state, order, {}};
  const auto& components = mechanism_.system.components();
  for (std::size_t c = 0; c < components.size(); ++c) {
    std::vector<double> now = memory_of(*components[c]);
    const bool same = !points_.empty() && *points_.back().memory[c] == now;
    point.memory.push_back(same ? points_.back().memory[c]
                                : std::make_shared<const std::vector<double>>(std::move(now)));
  }
  points_.push_back(std::move(point));
}

std::vector<const State*> MotionRecord::past(std::size_t k) const {
  std::vector<const State*> out;
  const auto order = static_cast<std::size_t>(std::clamp(points_[k].order, 1, kMaxBdfOrder));
  for (std::size_t j = 0; j < std::min(order, k); ++j) out.push_back(&points_[k - 1 - j].state);
  return out;
}

void MotionRecord::remember(std::size_t k) const {
  const auto& components = mechanism_.system.components();
  for (std::size_t c = 0; c < components.size(); ++c) {
    ConstSpan numbers = *points_[k].memory[c];
    const bool never_changed = points_.front().memory[c] == points_.back().memory[c];
    if (numbers.empty() || never_changed) continue;
    dynamic_cast<Remembers&>(*components[c]).restore(numbers);
  }
}

MotionAdjoint::MotionAdjoint(Mechanism& mechanism, const std::vector<char>& dropped, const MotionRecord& record,
                             const std::vector<Quantity>& quantities)
    : mechanism_(mechanism),
      dropped_(dropped),
      record_(record),
      quantities_(quantities),
      equations_(mechanism.system, nullptr, &mechanism.pool),
      slopes_(mechanism, kept(), std::nullopt) {}

std::vector<Index> MotionAdjoint::kept() {
  equations_.set_dropped(dropped_);
  return kept_constraints(equations_);
}

StateSlopes MotionAdjoint::nothing() const {
  const State& s = record_.state(0);
  const std::vector<double> n(s.v.size(), 0.0);
  return {n, n, n, std::vector<double>(s.lambda.size(), 0.0)};
}

void MotionAdjoint::add_quantities(std::size_t target, std::size_t step, StateSlopes& slopes) {
  for (std::size_t q = 0; q < quantities_.size(); ++q) {
    const double weight = weight_(target, step, q);
    if (weight == 0) continue;
    const StateSlopes own = slopes_.at(quantities_[q], record_.state(step));
    const auto add = [weight](const std::vector<double>& from, std::vector<double>& to) {
      for (std::size_t i = 0; i < from.size(); ++i) to[i] += weight * from[i];
    };
    add(own.q, slopes.q);
    add(own.v, slopes.v);
    add(own.a, slopes.a);
    add(own.lambda, slopes.lambda);
  }
}

void MotionAdjoint::go_back(std::size_t targets, const Weight& weight, const std::function<void()>& go_on) {
  weight_ = weight;
  const std::size_t last = record_.size() - 1;
  StepAdjoint step(equations_, mechanism_.system,
                   slopes_.steps(record_.state(0), mechanism_.system.constraint_pattern().ind), mechanism_.pool.size());
  // Slopes by the states k, k - 1 ... that later steps have added to.
  std::deque<std::vector<StateSlopes>> open;
  factors_.assign(last + 1, {});
  base::Stage stage("adjoint", static_cast<double>(last + 1), "steps");
  for (std::size_t k = last;; --k) {
    go_on();
    stage.reach(static_cast<double>(last - k));
    while (open.size() <= std::min<std::size_t>(kMaxBdfOrder, k)) open.emplace_back(targets, nothing());
    record_.remember(k);
    for (std::size_t t = 0; t < targets; ++t) add_quantities(t, k, open[0][t]);
    if (k == 0) break;
    const std::vector<const State*> past = record_.past(k);
    step.take(record_.state(k), past);
    for (std::size_t t = 0; t < targets; ++t) {
      StepMultipliers y = step.solve(open[0][t]);
      for (std::size_t j = 0; j < past.size(); ++j) step.add_to_past(y, j, open[j + 1][t]);
      factors_[k].push_back(
          {std::move(y.position), std::move(y.velocity), std::move(y.acceleration), std::move(y.motion)});
    }
    if (k == last || k % std::max<std::size_t>(1, last / kDefects) == 0)
      defect_ = std::max(defect_, step.defect(record_.state(k)));
    open.pop_front();
  }
  start_ = std::move(open[0]);
  defect_ = std::max(defect_, step.left());
}

std::vector<double> MotionAdjoint::lagrangian(Mechanism& side, const State& start,
                                              const std::vector<Quantity>& quantities) const {
  const std::size_t targets = start_.size(), m = start.lambda.size();
  std::vector<double> out(targets, 0.0), dq(start.v.size()), f(dq.size()), velocity(m), acceleration(m);
  mechanism_.system.local(record_.state(0).q, start.q, dq);
  for (std::size_t t = 0; t < targets; ++t)
    out[t] = dot(start_[t].q, dq) + dot(start_[t].v, start.v) + dot(start_[t].a, start.a) +
             dot(start_[t].lambda, start.lambda);
  Equations equations(side.system, nullptr, &side.pool);
  equations.set_dropped(dropped_);
  for (std::size_t k = 0; k < record_.size(); ++k) {
    const State& s = record_.state(k);
    for (std::size_t q = 0; q < quantities.size(); ++q) {
      double value = 0;
      bool known = false;
      for (std::size_t t = 0; t < targets; ++t) {
        const double weight = weight_(t, k, q);
        if (weight == 0) continue;
        if (!known) value = slopes_.value(quantities[q], s);
        known = true;
        out[t] += weight * value;
      }
    }
    if (k == 0) continue;
    equations.evaluate_constraints(s.t, s.q, s.v);
    equations.level(s.v, equations.nu(), velocity);
    equations.level(s.a, equations.gamma(), acceleration);
    equations.motion(s.view(), f);
    for (std::size_t t = 0; t < targets; ++t) {
      const Factors& y = factors_[k][t];
      out[t] -= dot(y.position, equations.phi()) + dot(y.velocity, velocity) + dot(y.acceleration, acceleration) +
                dot(y.motion, f);
    }
    side.system.accept(s.view());
  }
  return out;
}

}  // namespace espalier::dynamics::model

#include "dynamics/model/output/energy_balance.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "dynamics/dae/products.hpp"

namespace espalier::dynamics::model {

EnergyBalance::Rate EnergyBalance::rate_of(const State& s, double h) {
  constexpr double kPart = 1e-2;  // of a step: the difference is exact to its square; splines may end where it does
  const double e = kPart * h;
  const std::size_t n = s.v.size();
  Rate out;
  out.energy = system_.energy(s.view());
  q_.resize(s.q.size());
  v_.resize(n);
  change_.resize(n);
  const auto total = [&](double step) {
    for (std::size_t i = 0; i < n; ++i) {
      change_[i] = step * s.v[i];
      v_[i] = s.v[i] + step * s.a[i];
    }
    system_.retract(s.q, change_, q_);
    StateView at = s.view();
    at.t += step;
    at.q = q_;
    at.v = v_;
    const Energy there = system_.energy(at);
    return there.kinetic + there.potential;
  };
  const double here = out.energy.kinetic + out.energy.potential;
  out.power = e != 0 ? (4 * total(e) - total(2 * e) - 3 * here) / (2 * e) : 0;
  left_.resize(n);
  equations_.evaluate_constraints(s.t, s.q, s.v);
  system_.residual(s.view(), left_);
  add_transposed(system_.constraint_pattern(), equations_.phi_q(), s.lambda, left_);
  for (std::size_t i = 0; i < n; ++i) out.power -= s.v[i] * left_[i];
  if (!seen_) {
    std::fill(v_.begin(), v_.end(), speed_);
    StateView slow = s.view();
    slow.v = v_;
    nothing_ = system_.energy(slow).kinetic;
  }
  if (!seen_) lowest_ = highest_ = out.energy.potential;
  seen_ = true;
  kinetic_ = std::max(kinetic_, out.energy.kinetic);
  lowest_ = std::min(lowest_, out.energy.potential);
  highest_ = std::max(highest_, out.energy.potential);
  return out;
}

// Forwards: backwards, friction that slips would be the elastic spring that it has just left. Not beyond the end of a
// table.
EnergyBalance::Rate EnergyBalance::rate_at_end(const State& s, double h) {
  try {
    return rate_of(s, h);
  } catch (const Error&) {
    return rate_of(s, -h);
  }
}

void EnergyBalance::step(const State& s) {
  const double h = s.t - last_.t;
  if (!(h > 0)) return begin(s);
  if (++passed_ < every_) return;
  passed_ = 0;
  const Rate before = known_ ? *known_ : rate_of(last_, h), now = rate_at_end(s, h);
  const double work = 0.5 * h * (before.power + now.power);
  work_ += work;
  absolute_work_ += 0.5 * h * (std::abs(before.power) + std::abs(now.power));
  constexpr double kRounding = 1e-15;  // of the parts of an energy
  uncertainty_ += 0.25 * h * std::abs(now.power - before.power) + kRounding * (before.size() + now.size());
  gain_ += now.energy.kinetic + now.energy.potential - before.energy.kinetic - before.energy.potential - work;
  last_ = s;
  known_ = now;
}

double EnergyBalance::scale() const { return std::max({kinetic_, highest_ - lowest_, absolute_work_}); }

std::optional<std::string> EnergyBalance::notice() const {
  constexpr double kAllowed = 0.01;
  if (!(std::abs(gain_) > kAllowed * scale() + uncertainty_ + nothing_)) return std::nullopt;
  return fmt::format(
      "the steps of the integration {} {:.3g} of energy that no force explains, {:.1f} % of the largest of "
      "kinetic energy, change of potential energy and work ({:.3g}): the motion may be off by as much; "
      "smaller tolerances (relative, absolute, absolute_velocity) or shorter steps bring it down",
      gain_ > 0 ? "added" : "took away", std::abs(gain_), 100 * std::abs(gain_) / scale(), scale());
}

}  // namespace espalier::dynamics::model

// Steps that must not pass a switch of a law unseen, or outlast what forces drive that fall with the speed.
#include <algorithm>
#include <cmath>

#include "dynamics/integrators/bdf.hpp"
#include "dynamics/integrators/interpolation.hpp"

namespace espalier::dynamics {
namespace {

// A share of the first try: so near to a switch rounding decides on which side a law is.
constexpr double kShortestOfTry = 1e-9;
// A rate of growth times h' up to this is growth in the formulas too; from 1 on they damp it.
constexpr double kResolvedGrowth = 0.3;
// Masses along forces that fall with the speed are measured anew after so many steps.
constexpr long kMeasureEvery = 20;

}  // namespace

// Where the step should end, so that no law has switched in it unseen.
double BdfIntegrator::unseen_share() {
  if (switching_.empty()) return 1;
  if (on_device()) vectors_.fetch_state(trial_);
  double squares = 0;
  for (std::size_t i = 0; i < state_.v.size(); ++i) {
    const double change = trial_.v[i] - state_.v[i];
    const double weight = 1 / (tolerance_of_velocity(i) * share_v_);
    squares += change * change * weight * weight;
  }
  const StepPath path(
      state_, trial_, [this](double t) { return between(equations_.system(), state_, trial_, t); },
      std::sqrt(squares / static_cast<double>(std::max<std::size_t>(1, state_.v.size()))),
      std::min(options_.absolute, options_.absolute_velocity));
  double share = 1;
  for (Switching* law : switching_) share = std::min(share, law->unseen(path));
  const double shortest = std::max(kShortestOfTry * longest_try_, 1e-13 * std::abs(state_.t));
  return share * formula_.h > shortest ? share : 1;
}

// Friction that falls with the speed, where the speed is: h' (-slope) <= kResolvedGrowth m.
double BdfIntegrator::growing_share() {
  growing_step_ = std::numeric_limits<double>::infinity();
  if (switching_.empty() || on_device()) return 1;
  std::vector<FallingForce> forces;
  for (Switching* law : switching_) law->add_falling(trial_.view(), forces);
  if (forces.empty()) return 1;
  if (forces.size() != falling_masses_.size() || counts_.steps - falling_measured_ > kMeasureEvery)
    measure_falling_masses(forces);
  double share = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < forces.size(); ++k)
    share = std::min(share, kResolvedGrowth * falling_masses_[k] / (-forces[k].slope * formula_.hp));
  growing_step_ = share * formula_.h;
  constexpr double kHysteresis = 0.7;
  return share < kHysteresis && growing_step_ > 1e-13 * std::abs(state_.t) ? share : 1;
}

// 1 / m = d^T x, K [x; .] = [d; 0] with W = F_a.
void BdfIntegrator::measure_falling_masses(const std::vector<FallingForce>& forces) {
  equations_.evaluate_constraints(trial_.t, trial_.q, {});
  equations_.factorize(trial_.view(), {1, 0, 0});
  factor_hp_ = 0;
  falling_measured_ = counts_.steps;
  falling_masses_.clear();
  std::vector<double> x(state_.v.size() + state_.lambda.size());
  for (const FallingForce& f : forces) {
    std::fill(x.begin(), x.end(), 0.0);
    const auto coordinate = [&](std::size_t i) { return at(f.coordinates[i]); };
    for (std::size_t i = 0; i < f.direction.size(); ++i)
      if (f.coordinates[i] >= 0) x[coordinate(i)] += f.direction[i];
    equations_.solve(x);
    double mobility = 0;
    for (std::size_t i = 0; i < f.direction.size(); ++i)
      if (f.coordinates[i] >= 0) mobility += f.direction[i] * x[coordinate(i)];
    falling_masses_.push_back(mobility > 0 ? 1 / mobility : std::numeric_limits<double>::infinity());
  }
}

}  // namespace espalier::dynamics

#include "dynamics/model/fmu/instant.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "dynamics/dae/products.hpp"
#include "dynamics/integrators/initial.hpp"
#include "dynamics/integrators/linearised.hpp"

namespace espalier::dynamics::model {

Instant::Instant(Runner& runner)
    : runner_(runner), equations_(runner.mechanism().system, nullptr, runner.mechanism().step_pool) {}

void Instant::solve(State& state) {
  equations_.set_dropped(runner_.equations().dropped());
  make_consistent(equations_, state);
}

void Instant::follow(const State& state, ConstSpan force, StateMove& move) {
  System& system = runner_.mechanism().system;
  const std::size_t n = state.v.size(), m = state.lambda.size();
  std::vector<double> b(force.begin(), force.end());
  const auto moves = [](const std::vector<double>& x) { return max_norm(x) > 0; };
  if (moves(move.q) || moves(move.v)) {
    const TangentMatrices w = tangent_matrices(system, state);
    add_transposed(system.tangent_pattern(), w.stiffness.values, move.q, b);
    add_transposed(system.tangent_pattern(), w.damping.values, move.v, b);
  }
  for (double& x : b) x = -x;
  b.resize(n + m, 0.0);
  equations_.evaluate_constraints(state.t, state.q, state.v);
  equations_.factorize(state.view(), {1, 0, 0});
  equations_.solve(b);
  const auto middle = b.begin() + static_cast<std::ptrdiff_t>(n);
  move.a.assign(b.begin(), middle);
  move.lambda.assign(middle, b.end());
}

std::vector<double> Instant::force_slope(const State& state, const std::function<void(double)>& set_inputs,
                                         double step) {
  std::vector<double> slope(state.v.size(), 0.0), f(slope.size());
  for (const auto& [way, weight] : {std::pair{1.0, 8.0}, {-1.0, -8.0}, {2.0, -1.0}, {-2.0, 1.0}}) {
    set_inputs(way * step);
    std::fill(f.begin(), f.end(), 0.0);
    for (const auto& component : runner_.mechanism().system.components())
      if (component->sizes().velocity == 0) component->residual(state.view(), f);
    for (std::size_t i = 0; i < f.size(); ++i) slope[i] += weight * f[i] / (12 * step);
  }
  set_inputs(0);
  return slope;
}

std::string why_no_ode(Runner& runner) {
  Mechanism& mechanism = runner.mechanism();
  const Sizes sizes = mechanism.system.sizes();
  if (sizes.constraints > 0)
    return fmt::format("it has {} constraint equations (the first: {}), which make it a differential-algebraic one",
                       sizes.constraints, mechanism.system.constraint_name(0));
  for (const BuiltBody& body : mechanism.bodies)
    if (body.rigid != nullptr)
      return fmt::format("the rigid body '{}' has a unit quaternion, four numbers for three rotations", body.spec.name);
  if (sizes.configuration != sizes.velocity)
    return fmt::format("its configuration has {} numbers for {} velocities", sizes.configuration, sizes.velocity);
  if (!mechanism.surface_contacts.empty())
    return fmt::format("the contact '{}' remembers where it touched", mechanism.surface_contacts.front().name);
  if (!mechanism.conditions.empty()) return "it has [events], at which its state may jump";
  for (const auto& component : mechanism.system.components())
    if (component.get() != mechanism.controls && !memory_of(*component).empty())
      return fmt::format("'{}' remembers its past beside positions and velocities", component->name());
  return {};
}

}  // namespace espalier::dynamics::model

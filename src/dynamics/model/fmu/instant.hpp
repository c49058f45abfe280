/// \file
/// What follows from a state at once, without a step: accelerations, reactions, and the quantities that depend on them.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "dynamics/model/run/runner.hpp"

namespace espalier::dynamics::model {

/// A small move of a state; dq is a tangent vector. n, n, n and m numbers.
struct StateMove {
  std::vector<double> q, v, a, lambda;
};

/// Has a factor of its own: the run does not notice it. The runner must outlive it.
class Instant {
 public:
  explicit Instant(Runner& runner);

  /// Gives a state accelerations and multipliers, by the present inputs; where there are constraints, positions and
  /// velocities become the nearest that satisfy them. @throws espalier::Error
  void solve(State& state);

  /// How accelerations and multipliers follow (da, dlambda of `move`), with the equations linearised by their tangent,
  ///   F_a da + (Phi_q^T + F_lambda) dlambda = -(F_q dq + F_v dv + force),   Phi_q da = 0
  /// @param force  what else moves F, n numbers @pre solve() made the state; dq = dv = 0 where there are constraints
  void follow(const State& state, ConstSpan force, StateMove& move);

  /// dF along inputs: a central difference of fourth order at a fixed state, of those components alone that have no
  /// coordinates of their own. Where a force is linear in inputs, it has rounding errors of that force alone.
  /// @param set_inputs  lets them lie that far along @param step  of the difference
  [[nodiscard]] std::vector<double> force_slope(const State& state, const std::function<void(double)>& set_inputs,
                                                double step);

 private:
  Runner& runner_;
  Equations equations_;
};

/// Why a model is no ordinary differential equation in minimal coordinates, whose states an integrator of somebody else
/// may hold; empty: it is one.
[[nodiscard]] std::string why_no_ode(Runner& runner);

}  // namespace espalier::dynamics::model

/// \file
/// What follows from a state at once, without a step: accelerations, reactions, and the quantities that depend on them.
#pragma once

#include <string>

#include "dynamics/model/runner.hpp"

namespace espalier::dynamics::model {

/// Has a factor of its own: the run does not notice it. The runner must outlive it.
class Instant {
 public:
  explicit Instant(Runner& runner);

  /// Gives a state accelerations and multipliers, by the present inputs; where there are constraints, positions and
  /// velocities become the nearest that satisfy them. @throws espalier::Error
  void solve(State& state);

 private:
  Runner& runner_;
  Equations equations_;
};

/// Why a model is no ordinary differential equation in minimal coordinates, whose states an integrator of somebody else
/// may hold; empty: it is one.
[[nodiscard]] std::string why_no_ode(Runner& runner);

}  // namespace espalier::dynamics::model

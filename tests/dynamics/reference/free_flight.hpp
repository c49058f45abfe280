/// \file
/// A reduced body that flies freely, and what it should keep.
#pragma once

#include <algorithm>
#include <cmath>

#include "dynamics/bodies/reduced_body.hpp"
#include "dynamics/integrators/bdf.hpp"
#include "dynamics/integrators/initial.hpp"
#include "dynamics/model/mechanism.hpp"

namespace espalier::dynamics {

/// Changes of momenta and energy, relative; the largest strain energy over the energy at the start.
struct Drift {
  double momentum = 0, angular = 0, energy = 0, strain = 0;
};

/// The first body of the mechanism, which is reduced and alone, until `end`.
inline Drift free_flight(model::Mechanism& mechanism, double tolerance, double end) {
  const ReducedBody& body = *mechanism.bodies[0].reduced;
  Equations equations(mechanism.system);
  State s(mechanism.system.sizes());
  mechanism.system.initial(s.q, s.v);
  make_consistent(equations, s);
  BdfOptions options;
  options.relative = options.absolute = tolerance;
  BdfIntegrator bdf(equations, options);
  bdf.start(s);
  const MassProperties before = body.mass_properties(s.q, s.v);
  const double energy = mechanism.system.energy(s.view()).total();
  Drift drift;
  bdf.integrate(end, [&](const StepReport&) {
    drift.strain = std::max(drift.strain, body.strain_energy(bdf.state().q) / energy);
    return true;
  });
  const MassProperties after = body.mass_properties(bdf.state().q, bdf.state().v);
  const auto change = [](const Point& a, const Point& b) {
    return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]) / std::hypot(a[0], a[1], a[2]);
  };
  drift.momentum = change(before.momentum, after.momentum);
  drift.angular = change(before.angular_momentum, after.angular_momentum);
  drift.energy = std::abs(mechanism.system.energy(bdf.state().view()).total() - energy) / energy;
  return drift;
}

}  // namespace espalier::dynamics

#include "dynamics/model/fmu/instant.hpp"

#include <fmt/format.h>

#include "dynamics/integrators/initial.hpp"

namespace espalier::dynamics::model {

Instant::Instant(Runner& runner)
    : runner_(runner), equations_(runner.mechanism().system, nullptr, runner.mechanism().step_pool) {}

void Instant::solve(State& state) {
  equations_.set_dropped(runner_.equations().dropped());
  make_consistent(equations_, state);
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
  std::vector<double> memory;
  for (const auto& component : mechanism.system.components())
    if (component.get() != mechanism.controls) {
      component->save(memory);
      if (!memory.empty())
        return fmt::format("'{}' remembers its past beside positions and velocities", component->name());
    }
  return {};
}

}  // namespace espalier::dynamics::model

// Models, and parameters, whose derivatives nobody has.
#include "dynamics/contact/contact.hpp"
#include "dynamics/model/derivatives/sensitivity_run.hpp"

namespace espalier::dynamics::model {

void refuse_what_does_not_pass(const Description& model, SensitivityMethod method) {
  if (!model.controllers.empty())
    throw Error(StatusCode::invalid_input,
                fmt::format("sensitivities, also adjoint ones, do not pass FMUs, which do not tell how they depend on "
                            "parameters and states, and the model has '{}'",
                            model.controllers.front().name));
  if (!model.events.empty())
    throw Error(StatusCode::invalid_input,
                fmt::format("sensitivities do not pass events yet, and the model has {}", model.events.size()));
  for (const BodySpec& body : model.bodies)
    if (body.erosion() != nullptr)
      fail(body.erosion()->place,
           "sensitivities, also adjoint ones, do not pass elements that fail: whether one does is no "
           "smooth function of a parameter");
  for (const ContactSpec& c : model.contacts) {
    // The copies do not take part in what these do between Newton's passes, or in jumps of the velocities.
    if (c.law.impulse || c.penetration > 0)
      fail(c.place, fmt::format("sensitivities do not pass contacts with {} yet",
                                c.law.impulse ? "impulses (the penalty works)"
                                              : "a chosen penetration (stiffness alone works)"));
    if (c.law.rubs() && (model.statics || model.initial.statics))
      fail(c.place,
           "sensitivities of equilibria do not pass contacts with friction yet, whose forces "
           "depend on the way there");
  }
  if (model.linear())
    fail(model.statics->place,
         "sensitivities do not know linear statics yet: take linear out, and loads that are small");
  for (const JointSpec& j : model.joints) {
    if (j.type != JointType::rolling && j.type != JointType::skate) continue;
    if (method == SensitivityMethod::adjoint)
      fail(j.place, "the adjoint method does not pass rolling yet: take the forward one");
    if (model.statics || model.initial.statics)
      fail(j.place,
           "sensitivities of equilibria do not pass rolling, where the place of rest depends on the "
           "way there");
  }
  if (method == SensitivityMethod::adjoint && model.initial.modes > 0)
    throw Error(StatusCode::invalid_input,
                "the adjoint method finds derivatives of quantities, not of [initial] modes: take the forward one");
  if (method == SensitivityMethod::adjoint && !model.statics)
    for (const BodySpec& body : model.bodies)
      if (body.modal_damping > 0)
        fail(body.place,
             "the adjoint method does not pass damping by ratio of modes yet: take the forward one, "
             "or give the ratio at two frequencies (damping = { ratio = ..., frequencies = [...] })");
}

void refuse_memory(const Description& model, const Mechanism& mechanism) {
  for (const ContactSpec& c : model.contacts) {
    bool solid = false;
    for (const BuiltContact& built : mechanism.surface_contacts)
      for (const contact::Contact* part : built.parts)
        solid = solid || (built.name == c.name && dynamic_cast<const contact::RigidContact*>(part) == nullptr);
    if (c.law.rubs() || c.law.restitution < 1 || solid)
      fail(c.place,
           "the adjoint method does not pass contacts with friction or restitution, or of "
           "deformable bodies, which remember something from step to step: take the forward one");
  }
}

void refuse_other_run(const Description& model, const Description& side, const std::string& path) {
  const std::string fixed = fmt::format(
      "depends on {}; derivatives hold times, tolerances, outputs, the solver and the load factor of a run fixed, so "
      "give numbers that do not depend on it",
      path);
  const auto refuse = [&](const Place& place) { fail(place, "something here " + fixed); };
  if (!model.statics && !(side.integrator == model.integrator)) refuse(model.integrator.place);
  if (!(side.statics == model.statics)) refuse(model.statics->place);
  if (!(side.initial == model.initial)) refuse(model.initial.place);
  if (!(side.output == model.output)) refuse(model.output.place);
  if (side.solver != model.solver) throw Error(StatusCode::invalid_input, "solver: something here " + fixed);
}

}  // namespace espalier::dynamics::model

// The start of a run: a consistent state, or an equilibrium, and the integrator.
#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "dynamics/integrators/bdf.hpp"
#include "dynamics/integrators/generalized_alpha.hpp"
#include "dynamics/model/build/default_tolerances.hpp"
#include "dynamics/model/run/restart.hpp"
#include "dynamics/model/run/runner.hpp"
#include "dynamics/model/run/start_report.hpp"

namespace espalier::dynamics::model {

namespace {

/// The least slip speed of friction in joints and on guides, as a speed of a coordinate; infinite without any.
double least_slip_speed(const Description& model) {
  double least = std::numeric_limits<double>::infinity();
  for (const JointSpec& j : model.joints)
    if (j.friction && j.friction->curve.static_coefficient > 0)
      least = std::min(least, j.friction->curve.slip_speed / std::max(1.0, j.friction->radius));
  for (const ForceSpec& f : model.forces)
    if (f.friction > 0) least = std::min(least, f.slip_speed);
  return least;
}

}  // namespace

void Runner::prepare() {
  state_ = State(mechanism_->system.sizes());
  state_.t = model_.statics ? model_.statics->time : model_.integrator.start;
  mechanism_->system.initial(state_.q, state_.v);
  const State given = state_;
  guard_ = std::make_unique<RedundancyGuard>(*equations_);
  if (mechanism_->controls != nullptr) guard_->set_absent(mechanism_->controls->absent_rows(state_.lambda.size()));
  ConsistencyOptions consistency;
  consistency.allowed_position = model_.initial.position_tolerance;
  consistency.kept_velocities = given_velocities(*mechanism_);
  const bool statics = model_.initial.statics && options_.restart.empty();
  try {
    if (statics || model_.statics) {
      guard_->analyze(state_);  // statics closes the joints itself, while it puts the loads on
    } else {
      const ConsistencyResult result = guard_->prepare(state_, consistency);
      summary_.position_change = result.position_change;
      summary_.velocity_change = result.velocity_change;
      if (result.position_change > 0 && options_.restart.empty()) check_overlaps(model_, *mechanism_, state_);
    }
  } catch (const Error& error) {
    state_ = given;  // where the joints could not be closed from
    throw Error(error.status().code, explain_failure(error), error.status().row);
  }
  reference_ = model_.initial.statics ? given : state_;
  describe_system();
  if (options_.restart.empty()) {
    for (const auto& lines : {open_joints(*mechanism_, given), moved_bodies(*mechanism_, given, state_)})
      summary_.notices.insert(summary_.notices.end(), lines.begin(), lines.end());
  }
  if (options_.restart.empty() && !model_.initial.statics && !model_.statics) check_velocities(given, state_);
  if (statics) find_equilibrium(consistency);
  begin_controllers();
  if (!model_.statics) set_modal_damping();
  if (options_.restart.empty() && !model_.statics) find_modes();
  if (model_.statics) mechanism_->system.set_load_factor(0);
  summary_.t_begin = time();
  summary_.energy_begin = to_public(mechanism_->system.energy(state_.view()));
}

void Runner::describe_system() {
  const Sizes sizes = mechanism_->system.sizes();
  summary_.redundant = guard_->notices();
  for (const BuiltBody& body : mechanism_->bodies)
    for (const std::string& notice : body.notices) summary_.notices.push_back(body.spec.name + ": " + notice);
  summary_.notices.insert(summary_.notices.end(), mechanism_->notices.begin(), mechanism_->notices.end());
  summary_.bodies = static_cast<Index>(mechanism_->bodies.size());
  summary_.joints = static_cast<Index>(mechanism_->joints.size());
  summary_.forces = static_cast<Index>(model_.forces.size());
  summary_.velocities = sizes.velocity;
  summary_.constraints = sizes.constraints;
  summary_.degrees_of_freedom = guard_->degrees_of_freedom();
}

void Runner::check_velocities(const State& given, const State& consistent) {
  const double allowed = model_.initial.velocity_tolerance * std::max(max_norm(consistent.v), max_norm(given.v));
  const std::optional<MovedVelocity> kept = changed_velocity(*mechanism_, given, consistent, allowed, true);
  if (kept && !model_.initial.project_velocities)
    fail(kept->body->spec.place,
         fmt::format(
             "the initial velocity contradicts the constraints: the velocity of {} is {:g} in the text, {:g} is "
             "the nearest that all given velocities allow for; correct those of the bodies joined to '{}', or "
             "set initial.velocities = \"project\" to take the nearest",
             mechanism_->system.coordinate_name(kept->coordinate), kept->given, kept->found, kept->body->spec.name));
  const std::vector<std::string> lines = velocity_notices(*mechanism_, given, consistent, allowed);
  summary_.notices.insert(summary_.notices.end(), lines.begin(), lines.end());
}

void Runner::start_integrator() {
  if (model_.integrator.method == Method::bdf) {
    if (wants_default_tolerances(model_.integrator))
      set_default_tolerances(model_.integrator, *equations_, *mechanism_, model_, state_, duration_);
    model_.integrator.bdf.slip_speed = least_slip_speed(model_);
    integrator_ = std::make_unique<BdfIntegrator>(*equations_, model_.integrator.bdf);
  } else {
    AlphaOptions alpha = model_.integrator.alpha;
    alpha.search = !model_.contacts.empty();
    integrator_ = std::make_unique<GeneralizedAlpha>(*equations_, alpha);
  }
  integrator_->start(state_);
  equations_->allow_device();
  if (const std::string& notice = equations_->device_notice(); !notice.empty()) summary_.notices.push_back(notice);
  events_ = std::make_unique<EventWatch>(model_, *mechanism_);
  if (!options_.restart.empty()) {
    for (const std::string& change : read_restart(options_.restart, options_.accept_changes, *mechanism_, *integrator_))
      summary_.notices.push_back("accepted: " + change);
    take_up_switches();
    guard_->check(current());
    // A run that was killed after its last restart file has nothing to do but to write its results.
    if (time() > model_.integrator.end)
      throw Error(StatusCode::invalid_input,
                  fmt::format("{}: the state is at t = {:g}, the run ends at {:g} already; give a later --until",
                              options_.restart, time(), model_.integrator.end));
    if (reached(model_.integrator.end))
      summary_.notices.push_back(
          fmt::format("{}: the run is complete, nothing was left to do; a later --until goes on", options_.restart));
    summary_.t_begin = time();
    summary_.energy_begin = to_public(mechanism_->system.energy(current().view()));
  }
  last_report_.t = time();
  dropped_at_start_ = equations_->dropped();
}

}  // namespace espalier::dynamics::model

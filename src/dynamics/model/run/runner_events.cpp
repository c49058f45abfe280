// What a run does when something happens: stops, sets inputs, switches joints and forces, and goes on from there.
#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

#include "dynamics/model/build/builders.hpp"
#include "dynamics/model/joint_kinds/kind.hpp"
#include "dynamics/model/run/runner.hpp"

namespace espalier::dynamics::model {

// One thing may lead to the next at the same time; what has no end is an error. What strikes then is an impact.
void Runner::happen() {
  if (events_->empty()) return;
  act_on_events();
  if (events_->strikes(current().view())) meet_impacts();
}

void Runner::act_on_events() {
  constexpr int kMostRounds = 100;
  for (int round = 0; round < kMostRounds; ++round) {
    const std::vector<std::size_t> events = events_->happening(current().view());
    events_->note(current().view(), events);
    if (events.empty()) return;
    Change change;
    for (const std::size_t k : events) {
      std::vector<double> settings;
      for (const StateFunctionPtr& value : mechanism_->settings[k]) settings.push_back(value->value(current().view()));
      act(model_.events[k], settings, change);
    }
    if (change.any) begin_anew(model_.events[events.front()], change);
  }
  fail(model_.events.front().place,
       fmt::format("events set each other off at t = {:g} without end; let one of them happen only 'once'", time()));
}

void Runner::act(const EventSpec& event, const std::vector<double>& settings, Change& change) {
  constexpr std::size_t kMostKept = 10000;
  if (summary_.events.size() < kMostKept) summary_.events.push_back({event.name, time()});
  ++summary_.event_count;
  if (event.stop && !stopped_) {
    stopped_ = true;
    summary_.stopped_by = event.name;
  }
  Controls& controls = *mechanism_->controls;
  for (std::size_t i = 0; i < settings.size(); ++i) {
    double& input = *controls.input(event.set[i].first);
    change.any = change.any || input != settings[i];
    input = settings[i];
  }
  const auto switch_all = [&](const std::vector<std::string>& names, bool on) {
    for (const std::string& name : names) {
      if (!controls.set(name, on)) continue;
      const bool joint = mechanism_->joint(name) != nullptr;
      if (joint && on) begin_joint(name);
      change = {true, change.joints || joint, change.joints_on || (joint && on)};
    }
  };
  switch_all(event.off, false);
  switch_all(event.on, true);
}

// Motors and distances that count from "initial", and couplings, begin with what they find.
void Runner::begin_joint(const std::string& name) {
  for (const JointSpec& spec : model_.joints) {
    if (spec.name == name && (spec.relative || spec.measured || joint_kind(spec.type).couples))
      mechanism_->joint(name)->hold_here(time(), current().q);
  }
}

// Positions stay (joints that are switched on must fit), velocities take a plastic impact where such joints ask for
// other ones, accelerations and multipliers are those after the change; the integrator begins anew.
void Runner::begin_anew(const EventSpec& event, const Change& change) {
  Controls& controls = *mechanism_->controls;
  controls.apply();
  state_ = current();
  ConsistencyOptions options;
  options.allowed_position = event.position_tolerance;
  const Energy before = mechanism_->system.energy(state_.view());
  at_place(event.place, [&] {
    if (change.joints) {
      guard_->set_absent(controls.absent_rows(state_.lambda.size()));
      guard_->prepare(state_, options);
      controls.dropped = equations_->dropped();
      summary_.degrees_of_freedom = guard_->degrees_of_freedom();
    } else {
      make_consistent(*equations_, state_, options);
    }
  });
  if (const double lost = before.kinetic - mechanism_->system.energy(state_.view()).kinetic;
      change.joints_on && lost > 1e-9 * before.kinetic)
    summary_.notices.push_back(
        fmt::format("event '{}' at t = {:g}: the joints switched on take {:.6g} of the kinetic "
                    "energy, {:.6g} (a plastic impact)",
                    event.name, time(), lost, before.kinetic));
  integrator_->start(state_);
  watch_from_here();
}

// After a restart: the rows that were left out when the file was written.
void Runner::take_up_switches() {
  if (mechanism_->controls == nullptr || mechanism_->controls->dropped.empty()) return;
  if (mechanism_->controls->dropped.size() != state_.lambda.size())
    throw Error(StatusCode::invalid_input, options_.restart + ": the restart file is damaged");
  guard_->set_absent(mechanism_->controls->absent_rows(state_.lambda.size()));
  guard_->adopt(mechanism_->controls->dropped);
}

std::vector<std::pair<std::string, double>> Runner::inputs() const {
  return mechanism_->controls == nullptr ? std::vector<std::pair<std::string, double>>() : mechanism_->controls->inputs;
}

void Runner::set_input(const std::string& name, double value) {
  if (!std::isfinite(value)) throw std::invalid_argument("input \"" + name + "\": the value must be a finite number");
  double* input = mechanism_->controls == nullptr ? nullptr : mechanism_->controls->input(name);
  if (input != nullptr) {
    *input = value;
    return;
  }
  std::vector<std::string> names;
  for (const auto& known : inputs()) names.push_back(known.first);
  throw std::invalid_argument("there is no input \"" + name + "\"" + suggestion(name, names));
}

}  // namespace espalier::dynamics::model

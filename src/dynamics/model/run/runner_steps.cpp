// A motion in pieces: steps to a time of the caller's, states saved and restored, chosen quantities kept in memory.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "dynamics/model/run/restart.hpp"
#include "dynamics/model/run/runner.hpp"

namespace espalier::dynamics::model {

void Runner::expect_motion(const char* call) const {
  if (model_.statics) throw std::logic_error(fmt::format("Simulation::{}: a statics run has no steps of time", call));
}

void Runner::step_to(double t, const SimulationObserver& observer) {
  expect_motion("step_to");
  if (!std::isfinite(t) || t < time())
    throw std::invalid_argument(fmt::format("Simulation::step_to: {} is no time from {} on", t, time()));
  constexpr double kShortest = 1e-100;  // squares of steps are still numbers
  if (t > time() && t - time() < kShortest)
    throw std::invalid_argument(
        fmt::format("Simulation::step_to: {} is {:g} from now, too short for a step", t, t - time()));
  guarded([&] {
    stopped_ = false;
    summary_.stopped_by.clear();
    if (!going_) go();
    advance(t, observer);
  });
}

std::string Runner::save() {
  expect_motion("save");
  return restart_bytes(*mechanism_, *integrator_);
}

// What the bytes say of themselves is checked before anything changes; numbers that do not fit are met on the way, and
// then the present state comes back.
void Runner::restore(std::string_view state) {
  expect_motion("restore");
  const std::string present = save();
  try {
    take_restart_bytes(state, "the saved state", *mechanism_, *integrator_);
    const std::size_t marks = mechanism_->controls == nullptr ? 0 : mechanism_->controls->dropped.size();
    if (marks != 0 && marks != state_.lambda.size())
      throw Error(StatusCode::invalid_input, "the saved state is damaged");
  } catch (const Error&) {
    take_restart_bytes(present, "the present state", *mechanism_, *integrator_);
    throw;
  }
  if (mechanism_->controls != nullptr) {
    const std::vector<char>& dropped = mechanism_->controls->dropped;
    guard_->set_absent(mechanism_->controls->absent_rows(state_.lambda.size()));
    guard_->adopt(dropped.empty() ? dropped_at_start_ : dropped);
  }
  watch_from_here();
  last_report_ = {};
  last_report_.t = time();
  last_report_.index = integrator_->counts().steps;
  stopped_ = false;
  const auto kept = std::upper_bound(series_.t.begin(), series_.t.end(), time()) - series_.t.begin();
  series_.t.resize(at(kept));
  series_.values.resize(at(kept) * series_.names.size());
  if (options_.frame_interval >= 0) kept_frames().restore(sample(last_report_).pictured());
  if (page_) page_->restore(sample(last_report_));
  usual_rows_.restore(time());
  finish();
}

void Runner::begin_keeping(const Sample& s, const State& initial) {
  if (options_.frame_interval >= 0 && kept_frames().frames().empty())
    kept_frames().begin(s.pictured(), s.load ? 0 : initial.t);
  keep(s);
}

KeptFrames& Runner::kept_frames() {
  if (!frames_) frames_ = std::make_unique<KeptFrames>(*mechanism_, options_.frame_interval, reference_);
  return *frames_;
}

std::vector<double> Runner::values_at(State state) {
  if (!guard_->redundant().empty()) guard_->share_reactions(state);
  const Sample s{&state, last_report_};
  std::vector<double> values;
  for (const Quantity& q : quantities_) values.push_back(q.value(s));
  return values;
}

SimulationFrame Runner::frame() { return kept_frames().frame(sample(last_report_).pictured()); }

void Runner::watch_from_here() {
  if (balance_) balance_->begin(current());
  held_.begin(current());
}

// A state that is there already (the start of a run that goes on) is not kept twice.
void Runner::keep(const Sample& s) {
  envelopes_->take(s);
  if (options_.frame_interval >= 0) kept_frames().step(s.pictured());
  show(s);
  if (!options_.keep_series || (!series_.t.empty() && series_.t.back() == s.time())) return;
  series_.t.push_back(s.time());
  for (const Quantity& q : quantities_) series_.values.push_back(q.value(s));
}

}  // namespace espalier::dynamics::model

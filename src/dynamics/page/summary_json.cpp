#include "dynamics/page/summary_json.hpp"

#include "dynamics/page/json_text.hpp"
#include "solver/options/option_text.hpp"

namespace espalier::dynamics::page {
namespace {

template <class List, class Write>
std::string list_of(const List& list, const Write& write) {
  std::vector<std::string> values;
  for (const auto& item : list) values.push_back(write(item));
  return json_list(values);
}

double whole(long x) { return static_cast<double>(x); }

std::string seconds_json(const SimulationPhases& p) {
  JsonObject json;
  json.number("setup", p.setup).number("assembly", p.assembly).number("analysis", p.analysis);
  json.number("factorization", p.factorization).number("solve", p.solve).number("output", p.output);
  return json.number("other", p.other).number("total", p.total).done();
}

void add_system(const SimulationSummary& s, JsonObject& json) {
  json.number("bodies", s.bodies).number("joints", s.joints).number("forces", s.forces);
  json.number("velocities", s.velocities).number("constraints", s.constraints);
  json.number("degrees_of_freedom", s.degrees_of_freedom);
  json.raw("redundant", json_texts(s.redundant)).raw("notices", json_texts(s.notices));
}

void add_results(const SimulationSummary& s, JsonObject& json) {
  json.raw("modes", list_of(s.modes, [](const SimulationMode& m) {
             return JsonObject().number("frequency", m.frequency).number("damping", m.damping_ratio).done();
           }));
  json.raw("critical", list_of(s.critical, [](const SimulationCritical& c) {
             return JsonObject().number("load", c.load).text("kind", c.limit ? "limit point" : "bifurcation").done();
           }));
  json.raw("peaks", list_of(s.peaks, [](const SimulationPeak& p) {
             JsonObject peak;
             peak.text("load", p.load).text("quantity", p.quantity).number("frequency", p.frequency);
             return peak.number("amplitude", p.amplitude).number("phase", p.phase).done();
           }));
  json.number("harmonic_points", s.harmonic_points).number("harmonic_solves", s.harmonic_solves);
  json.raw("events", list_of(s.events, [](const SimulationEvent& e) {
             return JsonObject().text("name", e.name).number("t", e.t).done();
           }));
  json.raw("stress_peaks", list_of(s.stress_peaks, [](const SimulationExtreme& x) {
             JsonObject peak;
             peak.text("body", x.body).number("node", static_cast<double>(x.node)).number("t", x.t);
             return peak.number("value", x.value).raw("place", json_numbers(x.place)).done();
           }));
  json.number("event_count", whole(s.event_count)).text("stopped_by", s.stopped_by);
  json.raw("values", list_of(s.values, [](const auto& value) {
             return JsonObject().text("name", value.first).number("value", value.second).done();
           }));
}

void add_run(const SimulationSummary& s, JsonObject& json) {
  json.number("t_begin", s.t_begin).number("t_end", s.t_end).number("steps", whole(s.steps));
  json.number("newton", whole(s.newton_iterations)).number("rejected", whole(s.error_failures));
  json.number("failures", whole(s.newton_failures)).number("factorizations", whole(s.factorizations));
  json.number("residuals", whole(s.residuals)).number("solves", whole(s.solves)).number("turned", whole(s.turned));
  json.number("statics_steps", whole(s.statics_steps)).number("statics_residual", s.statics_residual);
  json.number("position_change", s.position_change).number("velocity_change", s.velocity_change);
  json.number("energy_begin", s.energy_begin.kinetic + s.energy_begin.potential);
  json.number("energy_end", s.energy_end.kinetic + s.energy_end.potential);
  json.number("energy_work", s.energy_work).number("energy_gain", s.energy_gain);
  json.number("violation_position", s.largest_violation.position);
  json.number("violation_velocity", s.largest_violation.velocity);
  json.number("violation_acceleration", s.largest_violation.acceleration);
  json.raw("seconds", seconds_json(s.phases));
  json.text("device", s.device).text("kind", s.kind).text("precision", s.precision);
  json.number("nonzeros_factor", static_cast<double>(s.nonzeros_factor));
  json.number("peak_bytes", static_cast<double>(s.peak_bytes)).raw("files", json_texts(s.files));
}

}  // namespace

std::string summary_json(const SimulationSummary& s, const Status& status) {
  JsonObject json;
  json.text("status", s.interrupted ? "interrupted" : std::string(solver::name_of(status.code)));
  json.text("message", status.message).text("title", s.title).text("method", s.method);
  if (!s.units.empty()) json.text("units", s.units);
  add_system(s, json);
  add_results(s, json);
  add_run(s, json);
  return json.done();
}

}  // namespace espalier::dynamics::page

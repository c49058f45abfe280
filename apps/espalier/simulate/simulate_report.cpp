#include "simulate/simulate_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/memory.hpp"
#include "common/terminal.hpp"
#include "solver/options/option_text.hpp"
#include "solver/session/build_info.hpp"

namespace espalier::cli {

namespace {

using Json = nlohmann::ordered_json;

void add_phase(Table& table, const char* name, double part, double total) {
  table.add({name, duration(part), total > 0 ? fmt::format("{:.0f} %", 100 * part / total) : ""});
}

std::string phase_table(const SimulationPhases& p) {
  Table table("<>>");
  add_phase(table, "setup", p.setup, p.total);
  add_phase(table, "assembly", p.assembly, p.total);
  add_phase(table, "analysis", p.analysis, p.total);
  add_phase(table, "factorization", p.factorization, p.total);
  add_phase(table, "solve", p.solve, p.total);
  add_phase(table, "output", p.output, p.total);
  add_phase(table, "other", p.other, p.total);
  table.add({"total", duration(p.total), ""}, Tone::strong);
  return table.text();
}

std::string solver_line(const SimulationSummary& s) {
  if (s.kind == "dense") return "dense";
  const std::string device = s.device.substr(0, s.device.find(": "));  // without the reason
  return fmt::format("{} {}, {}, {} entries in the factor, {}", s.kind, s.precision, device, grouped(s.nonzeros_factor),
                     base::format_bytes(s.peak_bytes));
}

/// Where an extreme is.
std::string place_text(const SimulationExtreme& x) {
  if (x.body.empty()) return "";
  const std::string where = fmt::format("({:g} {:g} {:g}) of '{}'", x.place[0], x.place[1], x.place[2], x.body);
  return x.node != 0 ? fmt::format(", node {} {}", x.node, where) : ", " + where;
}

}  // namespace

std::string simulate_headline(const SimulationSummary& s) {
  return fmt::format("{}, {}, {} + {} unknowns, {}", counted(s.bodies, "body", "bodies"),
                     counted(s.joints, "joint", "joints"), grouped(s.velocities), grouped(s.constraints),
                     counted(s.degrees_of_freedom, "degree of freedom", "degrees of freedom"));
}

std::string simulate_summary(const SimulationSummary& s) {
  if (s.bodies == 0) return "";
  std::string text = fmt::format("{}\n", toned(Tone::strong, s.title));
  Table table("<<");
  table.add({"system", simulate_headline(s)});
  if (!s.units.empty()) table.add({"units", s.units});
  for (const std::string& notice : s.redundant) table.add({"redundant", notice});
  for (const std::string& notice : s.notices) table.add({"notice", notice});
  constexpr std::size_t kMostShown = 20;
  for (std::size_t k = 0; k < std::min(kMostShown, s.events.size()); ++k)
    table.add({"event", fmt::format("{} at t = {:.9g}{}", s.events[k].name, s.events[k].t,
                                    s.events[k].name == s.stopped_by ? " (the end)" : "")});
  if (s.event_count > static_cast<long>(kMostShown))
    table.add({"event", fmt::format("{} in all; the first {} are in the report", s.event_count, s.events.size())});
  if (s.method == "linear statics" && s.statics_steps > 0)
    table.add({"statics", fmt::format("linear, residual {}, backward error {}", small(s.statics_residual),
                                      small(s.statics_backward_error))});
  else if (s.statics_steps > 0)
    table.add({"statics", fmt::format("{}, {}, residual {}{}", counted(s.statics_steps, "load step", "load steps"),
                                      counted(s.statics_iterations, "iteration", "iterations"),
                                      small(s.statics_residual), s.statics_relaxed ? ", by relaxation" : "")});
  for (const SimulationCritical& c : s.critical)
    table.add({"critical", fmt::format("{} at load factor {:.9g}", c.limit ? "limit point" : "bifurcation", c.load)});
  for (const SimulationMode& m : s.modes)
    table.add({"mode", fmt::format("{:.6g} Hz, damping {:.2g} %", m.frequency, 100 * m.damping_ratio)});
  if (s.harmonic_points > 0)
    table.add({"harmonic", fmt::format("{}, {} solved", counted(s.harmonic_points, "frequency", "frequencies"),
                                       grouped(s.harmonic_solves))});
  for (std::size_t k = 0; k < std::min(kMostShown, s.peaks.size()); ++k)
    table.add({"peak", fmt::format("{}: {:.6g}, {:.2f} degrees at {:.6g} Hz ({})", s.peaks[k].quantity,
                                   s.peaks[k].amplitude, s.peaks[k].phase, s.peaks[k].frequency, s.peaks[k].load)});
  if (s.peaks.size() > kMostShown)
    table.add({"peak", fmt::format("{} in all; the others are in the report", s.peaks.size())});
  table.add({s.method.ends_with("statics") ? "load" : "time",
             fmt::format("{:g} to {:g}, {} ({})", s.t_begin, s.t_end, counted(s.steps, "step", "steps"), s.method)});
  table.add({"newton", fmt::format("{} iterations, {} failures, {} steps rejected", grouped(s.newton_iterations),
                                   s.newton_failures, s.error_failures)});
  if (s.analyses > 1)
    table.add({"analyses", fmt::format("{}, {} by following changes of the pattern", s.analyses, s.followed)});
  table.add(
      {"factorizations", fmt::format("{} ({} by step size, {} by slow Newton, {} by failures), turned {}, {} solves",
                                     grouped(s.factorizations), s.refactor_step, s.refactor_rate, s.refactor_failed,
                                     counted(s.turned, "time", "times"), grouped(s.solves))});
  table.add(
      {"constraints", fmt::format("position {}, velocity {}, acceleration {}", small(s.largest_violation.position),
                                  small(s.largest_violation.velocity), small(s.largest_violation.acceleration))});
  table.add({"energy",
             fmt::format("{:.9g} at the start, {:.9g} at the end", s.energy_begin.kinetic + s.energy_begin.potential,
                         s.energy_end.kinetic + s.energy_end.potential)});
  table.add({"solver", solver_line(s)});
  text += table.text();
  text += phase_table(s.phases);
  if (!s.values.empty()) {
    Table values("<>");
    for (const auto& [name, value] : s.values) values.add({name, fmt::format("{:.9g}", value)});
    text += values.text();
  }
  if (!s.envelopes.empty()) {
    Table extremes("<><");
    for (const SimulationEnvelope& e : s.envelopes)
      for (const auto& [word, x] : {std::pair{"largest", e.largest}, std::pair{"least", e.least}})
        extremes.add({fmt::format("{}, {}", e.quantity, word), fmt::format("{:.9g}", x.value),
                      fmt::format("at {:g}{}", x.t, place_text(x))});
    text += extremes.text();
  }
  if (!s.stress_peaks.empty()) {
    constexpr std::size_t kShown = 5;
    std::vector<SimulationExtreme> all = s.stress_peaks;
    std::stable_sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.value > b.value; });
    Table peaks("<><");
    for (std::size_t k = 0; k < std::min(kShown, all.size()); ++k)
      peaks.add({"von Mises stress of " + all[k].body, fmt::format("{:.6g}", all[k].value),
                 fmt::format("the largest at its surface, at {:g}, node {}", all[k].t, all[k].node)});
    text += peaks.text();
    if (all.size() > kShown) text += fmt::format("  less in {} more bodies\n", all.size() - kShown);
  }
  for (const std::string& file : s.files) text += fmt::format("  wrote {}\n", file);
  return text;
}

nlohmann::ordered_json to_json(const SimulationSummary& s, const std::string& model, int exit_code) {
  const auto number = [](double x) { return std::isfinite(x) ? Json(x) : Json(nullptr); };
  Json j;
  j["espalier"] = solver::version();
  j["status"] = s.interrupted ? "interrupted" : std::string(solver::name_of(s.status.code));
  j["message"] = s.status.message;
  j["exit_code"] = exit_code;
  j["model"] = model;
  j["title"] = s.title;
  if (!s.units.empty()) j["units"] = s.units;
  j["system"] = {{"bodies", s.bodies},           {"joints", s.joints},
                 {"forces", s.forces},           {"velocities", s.velocities},
                 {"constraints", s.constraints}, {"degrees_of_freedom", s.degrees_of_freedom},
                 {"redundant", s.redundant},     {"notices", s.notices}};
  j["initial"] = {{"position_change", number(s.position_change)},
                  {"velocity_change", number(s.velocity_change)},
                  {"statics_iterations", s.statics_iterations}};
  Json critical = Json::array();
  for (const SimulationCritical& c : s.critical)
    critical.push_back({{"load", c.load}, {"kind", c.limit ? "limit" : "bifurcation"}});
  j["statics"] = {{"steps", s.statics_steps},
                  {"iterations", s.statics_iterations},
                  {"residual", number(s.statics_residual)},
                  {"backward_error", number(s.statics_backward_error)},
                  {"relaxed", s.statics_relaxed},
                  {"critical", critical}};
  Json modes = Json::array();
  for (const SimulationMode& m : s.modes) {
    Json mode = {{"frequency", m.frequency},
                 {"damping_ratio", m.damping_ratio},
                 {"growth", m.growth},
                 {"whirl", m.whirl},
                 {"standing_frequency", number(m.standing_frequency)}};
    if (!m.values.empty()) {
      mode["displacement"] = number(m.displacement);
      for (const auto& [name, value] : m.values) mode["values"][name] = number(value);
    }
    modes.push_back(std::move(mode));
  }
  j["initial"]["modes"] = modes;
  Json peaks = Json::array();
  for (const SimulationPeak& p : s.peaks)
    peaks.push_back({{"load", p.load},
                     {"quantity", p.quantity},
                     {"frequency", p.frequency},
                     {"amplitude", p.amplitude},
                     {"phase", p.phase}});
  j["harmonic"] = {{"frequencies", s.harmonic_points}, {"solves", s.harmonic_solves}, {"peaks", peaks}};
  j["time"] = {{"begin", s.t_begin}, {"end", s.t_end}};
  Json events = Json::array();
  for (const SimulationEvent& e : s.events) events.push_back({{"name", e.name}, {"t", e.t}});
  j["events"] = {{"count", s.event_count}, {"stopped_by", s.stopped_by}, {"first", events}};
  j["integrator"] = {{"method", s.method},
                     {"steps", s.steps},
                     {"newton_iterations", s.newton_iterations},
                     {"error_failures", s.error_failures},
                     {"newton_failures", s.newton_failures},
                     {"crossings", s.crossings},
                     {"divisions", s.divisions},
                     {"rounded", s.rounded},
                     {"largest_rounding", number(s.largest_rounding)}};
  j["counts"] = {{"residuals", s.residuals},
                 {"tangents", s.tangents},
                 {"analyses", s.analyses},
                 {"factorizations", s.factorizations},
                 {"solves", s.solves},
                 {"followed", s.followed},
                 {"turned", s.turned},
                 {"refactor_first", s.refactor_first},
                 {"refactor_step", s.refactor_step},
                 {"refactor_rate", s.refactor_rate},
                 {"refactor_failed", s.refactor_failed}};
  const SimulationPhases& p = s.phases;
  j["seconds"] = {
      {"setup", p.setup}, {"assembly", p.assembly}, {"analysis", p.analysis}, {"factorization", p.factorization},
      {"solve", p.solve}, {"output", p.output},     {"other", p.other},       {"total", p.total}};
  j["constraints"] = {{"position", number(s.largest_violation.position)},
                      {"velocity", number(s.largest_violation.velocity)},
                      {"acceleration", number(s.largest_violation.acceleration)}};
  const auto energy = [&](const SimulationEnergy& e) {
    return Json{
        {"kinetic", number(e.kinetic)}, {"potential", number(e.potential)}, {"total", number(e.kinetic + e.potential)}};
  };
  j["energy"] = {{"begin", energy(s.energy_begin)},
                 {"end", energy(s.energy_end)},
                 {"work", s.energy_work},
                 {"gain", s.energy_gain}};
  j["solver"] = {{"kind", s.kind},
                 {"precision", s.precision},
                 {"device", s.device},
                 {"nonzeros_factor", s.nonzeros_factor},
                 {"flops", s.factor_flops},
                 {"predicted_bytes", s.predicted_bytes},
                 {"peak_bytes", s.peak_bytes}};
  j["values"] = Json::object();
  for (const auto& [name, value] : s.values) j["values"][name] = number(value);
  const auto extreme = [&](const SimulationExtreme& x) {
    Json out = {{"value", number(x.value)}, {"t", x.t}};
    if (x.body.empty()) return out;
    out["body"] = x.body;
    if (x.node != 0) out["node"] = x.node;
    out["place"] = x.place;
    return out;
  };
  for (const char* list : {"stress_peaks", "paths", "envelopes"}) j[list] = Json::array();
  for (const SimulationExtreme& x : s.stress_peaks) j["stress_peaks"].push_back(extreme(x));
  for (const SimulationPath& along : s.paths) {
    Json path = {
        {"name", along.name}, {"body", along.body}, {"t", along.t}, {"length", along.length}, {"places", along.places}};
    const auto points = along.length.size();
    for (std::size_t q = 0; q < along.quantities.size(); ++q)
      for (std::size_t k = 0; k < points; ++k)
        path["values"][along.quantities[q]].push_back(number(along.values[q * points + k]));
    j["paths"].push_back(path);
  }
  for (const SimulationEnvelope& e : s.envelopes) {
    j["envelopes"].push_back({{"quantity", e.quantity}, {"largest", extreme(e.largest)}, {"least", extreme(e.least)}});
  }
  j["files"] = s.files;
  j["matrices_written"] = s.dumped;
  return j;
}

}  // namespace espalier::cli

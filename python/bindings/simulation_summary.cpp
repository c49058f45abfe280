#include "simulation_summary.hpp"

#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <initializer_list>
#include <string>
#include <utility>

#include "solver/options/option_text.hpp"

namespace espalier::python {

namespace nb = nanobind;

namespace {

using Member = std::pair<const char*, nb::object>;

nb::dict dict_of(std::initializer_list<Member> members) {
  nb::dict d;
  for (const auto& [name, value] : members) d[name] = value;
  return d;
}

template <class T>
nb::object value_of(const T& x) {
  return nb::cast(x);
}

template <class List, class Make>
nb::list list_of(const List& items, const Make& make) {
  nb::list list;
  for (const auto& item : items) list.append(make(item));
  return list;
}

nb::dict named_values(const std::vector<std::pair<std::string, double>>& values) {
  nb::dict d;
  for (const auto& [name, value] : values) d[name.c_str()] = value;
  return d;
}

nb::dict mode_dict(const SimulationMode& m) {
  nb::dict d = dict_of({{"frequency", value_of(m.frequency)},
                        {"damping_ratio", value_of(m.damping_ratio)},
                        {"growth", value_of(m.growth)},
                        {"whirl", value_of(m.whirl)},
                        {"standing_frequency", value_of(m.standing_frequency)}});
  if (!m.values.empty()) {
    d["displacement"] = m.displacement;
    d["values"] = named_values(m.values);
  }
  return d;
}

nb::dict extreme_dict(const SimulationExtreme& x) {
  nb::dict d = dict_of({{"value", value_of(x.value)}, {"t", value_of(x.t)}});
  if (x.body.empty()) return d;
  d["body"] = x.body;
  if (x.node != 0) d["node"] = x.node;
  d["place"] = nb::make_tuple(x.place[0], x.place[1], x.place[2]);
  return d;
}

nb::dict path_dict(const SimulationPath& p) {
  nb::dict columns;
  const std::size_t points = p.length.size();
  for (std::size_t q = 0; q < p.quantities.size(); ++q) {
    const auto from = p.values.begin() + static_cast<std::ptrdiff_t>(q * points);
    columns[p.quantities[q].c_str()] = std::vector<double>(from, from + static_cast<std::ptrdiff_t>(points));
  }
  return dict_of({{"name", value_of(p.name)},
                  {"body", value_of(p.body)},
                  {"t", value_of(p.t)},
                  {"length", value_of(p.length)},
                  {"places", value_of(p.places)},
                  {"values", columns}});
}

nb::dict energy_dict(const SimulationEnergy& e) {
  return dict_of({{"kinetic", value_of(e.kinetic)},
                  {"potential", value_of(e.potential)},
                  {"total", value_of(e.kinetic + e.potential)}});
}

nb::dict initial_dict(const SimulationSummary& s) {
  return dict_of({{"position_change", value_of(s.position_change)},
                  {"velocity_change", value_of(s.velocity_change)},
                  {"statics_iterations", value_of(s.statics_iterations)},
                  {"modes", list_of(s.modes, mode_dict)}});
}

nb::dict statics_dict(const SimulationSummary& s) {
  const auto critical = [](const SimulationCritical& c) {
    return dict_of({{"load", value_of(c.load)}, {"kind", value_of(std::string(c.limit ? "limit" : "bifurcation"))}});
  };
  return dict_of({{"steps", value_of(s.statics_steps)},
                  {"iterations", value_of(s.statics_iterations)},
                  {"residual", value_of(s.statics_residual)},
                  {"backward_error", value_of(s.statics_backward_error)},
                  {"relaxed", value_of(s.statics_relaxed)},
                  {"critical", list_of(s.critical, critical)}});
}

nb::dict harmonic_dict(const SimulationSummary& s) {
  const auto peak = [](const SimulationPeak& p) {
    return dict_of({{"load", value_of(p.load)},
                    {"quantity", value_of(p.quantity)},
                    {"frequency", value_of(p.frequency)},
                    {"amplitude", value_of(p.amplitude)},
                    {"phase", value_of(p.phase)}});
  };
  return dict_of({{"frequencies", value_of(s.harmonic_points)},
                  {"solves", value_of(s.harmonic_solves)},
                  {"peaks", list_of(s.peaks, peak)}});
}

nb::dict events_dict(const SimulationSummary& s) {
  const auto event = [](const SimulationEvent& e) {
    return dict_of({{"name", value_of(e.name)}, {"t", value_of(e.t)}});
  };
  return dict_of({{"count", value_of(s.event_count)},
                  {"stopped_by", value_of(s.stopped_by)},
                  {"first", list_of(s.events, event)}});
}

nb::dict integrator_dict(const SimulationSummary& s) {
  return dict_of({{"method", value_of(s.method)},
                  {"steps", value_of(s.steps)},
                  {"newton_iterations", value_of(s.newton_iterations)},
                  {"error_failures", value_of(s.error_failures)},
                  {"newton_failures", value_of(s.newton_failures)},
                  {"crossings", value_of(s.crossings)},
                  {"divisions", value_of(s.divisions)},
                  {"rounded", value_of(s.rounded)},
                  {"largest_rounding", value_of(s.largest_rounding)}});
}

nb::dict counts_dict(const SimulationSummary& s) {
  return dict_of({{"residuals", value_of(s.residuals)},
                  {"tangents", value_of(s.tangents)},
                  {"analyses", value_of(s.analyses)},
                  {"factorizations", value_of(s.factorizations)},
                  {"solves", value_of(s.solves)},
                  {"followed", value_of(s.followed)},
                  {"turned", value_of(s.turned)},
                  {"refactor_first", value_of(s.refactor_first)},
                  {"refactor_step", value_of(s.refactor_step)},
                  {"refactor_rate", value_of(s.refactor_rate)},
                  {"refactor_failed", value_of(s.refactor_failed)}});
}

nb::dict seconds_dict(const SimulationPhases& p) {
  return dict_of({{"setup", value_of(p.setup)},
                  {"assembly", value_of(p.assembly)},
                  {"analysis", value_of(p.analysis)},
                  {"factorization", value_of(p.factorization)},
                  {"solve", value_of(p.solve)},
                  {"output", value_of(p.output)},
                  {"other", value_of(p.other)},
                  {"total", value_of(p.total)}});
}

nb::dict solver_dict(const SimulationSummary& s) {
  return dict_of({{"kind", value_of(s.kind)},
                  {"precision", value_of(s.precision)},
                  {"device", value_of(s.device)},
                  {"nonzeros_factor", value_of(s.nonzeros_factor)},
                  {"flops", value_of(s.factor_flops)},
                  {"predicted_bytes", value_of(s.predicted_bytes)},
                  {"peak_bytes", value_of(s.peak_bytes)}});
}

}  // namespace

nb::dict summary_dict(const SimulationSummary& s) {
  nb::dict d;
  d["status"] = s.interrupted ? "interrupted" : std::string(solver::name_of(s.status.code));
  d["message"] = s.status.message;
  d["title"] = s.title;
  if (!s.units.empty()) d["units"] = s.units;
  d["system"] = dict_of({{"bodies", value_of(s.bodies)},
                         {"joints", value_of(s.joints)},
                         {"forces", value_of(s.forces)},
                         {"velocities", value_of(s.velocities)},
                         {"constraints", value_of(s.constraints)},
                         {"degrees_of_freedom", value_of(s.degrees_of_freedom)},
                         {"redundant", value_of(s.redundant)},
                         {"notices", value_of(s.notices)}});
  d["initial"] = initial_dict(s);
  d["statics"] = statics_dict(s);
  d["harmonic"] = harmonic_dict(s);
  d["time"] = dict_of({{"begin", value_of(s.t_begin)}, {"end", value_of(s.t_end)}});
  d["events"] = events_dict(s);
  d["integrator"] = integrator_dict(s);
  d["counts"] = counts_dict(s);
  d["seconds"] = seconds_dict(s.phases);
  const SimulationViolation& v = s.largest_violation;
  d["constraints"] = dict_of({{"position", value_of(v.position)},
                              {"velocity", value_of(v.velocity)},
                              {"acceleration", value_of(v.acceleration)}});
  d["energy"] = dict_of({{"begin", energy_dict(s.energy_begin)},
                         {"end", energy_dict(s.energy_end)},
                         {"work", value_of(s.energy_work)},
                         {"gain", value_of(s.energy_gain)}});
  d["solver"] = solver_dict(s);
  d["values"] = named_values(s.values);
  d["envelopes"] = list_of(s.envelopes, [](const SimulationEnvelope& e) {
    return dict_of(
        {{"quantity", value_of(e.quantity)}, {"largest", extreme_dict(e.largest)}, {"least", extreme_dict(e.least)}});
  });
  d["stress_peaks"] = list_of(s.stress_peaks, extreme_dict);
  d["paths"] = list_of(s.paths, path_dict);
  d["files"] = s.files;
  d["matrices_written"] = s.dumped;
  return d;
}

}  // namespace espalier::python

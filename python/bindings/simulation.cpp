// The simulator's part of the module _core. Private: espalier/_simulation.py gives it types and checks.
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <memory>
#include <optional>
#include <type_traits>
#include <utility>

#include "arrays.hpp"
#include "bindings.hpp"
#include "espalier/dynamics.hpp"
#include "host.hpp"
#include "turns.hpp"

namespace espalier::python {

namespace {

using namespace nb::literals;

// A simulation with a lock; calls let other Python threads run.
class SimulationHandle {
 public:
  SimulationHandle(std::vector<std::string> set, std::string out, std::optional<double> until, std::string restart,
                   bool accept_changes, std::vector<std::string> quantities,
                   std::vector<std::pair<std::string, std::string>> solver, std::string analyses, double frames,
                   bool page) {
    SimulationOptions o;
    o.set = std::move(set);
    o.out = std::move(out);
    o.until = until;
    o.restart = std::move(restart);
    o.accept_changes = accept_changes;
    o.quantities = std::move(quantities);
    o.solver = std::move(solver);
    o.analyses = std::move(analyses);
    o.frame_interval = frames;
    o.keep_series = true;
    o.page = o.keep_page = page;
    o.interrupted = &Host::interrupted;
    o.interrupted_every = 0.1;
    simulation_ = std::make_unique<Simulation>(std::move(o));
  }

  Status load(const std::string& text, const std::string& name, bool is_path) {
    return turns_.call([&] { return is_path ? simulation_->load(text) : simulation_->load_text(text, name); });
  }
  Status run(const nb::object& observer) {
    return turns_.call([&] { return simulation_->run(told(observer)); });
  }
  Status step_to(double t, const nb::object& observer) {
    return turns_.call([&] { return simulation_->step_to(t, told(observer)); });
  }
  Status restore(std::string_view state) {
    return turns_.call([&] { return simulation_->restore(state); });
  }
  // Small calls, also from the observer of a run.
  template <class Body>
  std::invoke_result_t<Body, Simulation&> look(Body&& body) {
    return turns_.look([&] { return body(*simulation_); });
  }

 private:
  // What the observer raises stops the run and is raised when it has ended.
  static SimulationObserver told(const nb::object& observer) {
    if (observer.is_none()) return {};
    return [&observer](const SimulationStep& s) {
      const nb::gil_scoped_acquire gil;
      try {
        const nb::object answer = observer(nb::make_tuple(s.index, s.t, s.h, s.order, s.newton_iterations,
                                                          s.factorizations, s.failures, s.residual, s.error));
        return goes_on(answer);
      } catch (...) {
        Host::raised = std::current_exception();
        return false;
      }
    };
  }

  std::unique_ptr<Simulation> simulation_;
  Turns turns_{"a simulation was run, stepped or restored from its own observer"};
};

// Fields in the order of the classes in _pictures.py.
nb::tuple fields(SimulationMesh m) {
  const std::size_t cells = m.types.size(), offsets = m.offsets.size(), points = m.connectivity.size();
  return nb::make_tuple(array_of(std::move(m.types), {cells}), array_of(std::move(m.offsets), {offsets}),
                        array_of(std::move(m.connectivity), {points}), array_of(std::move(m.body), {cells}), m.bodies);
}

nb::tuple fields(SimulationFrame f) {
  const std::size_t points = f.points.size() / 3, cells = f.von_mises.size();
  return nb::make_tuple(f.t, array_of(std::move(f.points), {points, 3}),
                        array_of(std::move(f.displacement), {points, 3}), array_of(std::move(f.velocity), {points, 3}),
                        array_of(std::move(f.von_mises), {cells}));
}

nb::dict fields(const SimulationSummary& s) {
  nb::dict d;
  d["title"] = s.title;
  d["method"] = s.method;
  d["interrupted"] = s.interrupted;
  d["stopped_by"] = s.stopped_by;
  d["bodies"] = s.bodies;
  d["joints"] = s.joints;
  d["forces"] = s.forces;
  d["velocities"] = s.velocities;
  d["constraints"] = s.constraints;
  d["degrees_of_freedom"] = s.degrees_of_freedom;
  d["redundant"] = s.redundant;
  d["notices"] = s.notices;
  d["t_begin"] = s.t_begin;
  d["t_end"] = s.t_end;
  d["steps"] = s.steps;
  d["newton_iterations"] = s.newton_iterations;
  d["failures"] = s.error_failures + s.newton_failures;
  d["residuals"] = s.residuals;
  d["tangents"] = s.tangents;
  d["analyses"] = s.analyses;
  d["factorizations"] = s.factorizations;
  d["solves"] = s.solves;
  d["statics_residual"] = s.statics_residual;
  d["statics_backward_error"] = s.statics_backward_error;
  d["turned"] = s.turned;
  nb::list events, modes, critical, growth, whirl, standing;
  for (const SimulationEvent& e : s.events) events.append(nb::make_tuple(e.name, e.t));
  for (const SimulationMode& m : s.modes) {
    modes.append(nb::make_tuple(m.frequency, m.damping_ratio));
    growth.append(m.growth);
    whirl.append(m.whirl);
    standing.append(m.standing_frequency);
  }
  for (const SimulationCritical& c : s.critical) critical.append(nb::make_tuple(c.load, c.limit));
  d["events"] = events;
  d["modes"] = modes;
  d["mode_growth"] = growth;
  d["mode_whirl"] = whirl;
  d["mode_standing_frequency"] = standing;
  d["critical"] = critical;
  d["energy_begin"] = nb::make_tuple(s.energy_begin.kinetic, s.energy_begin.potential);
  d["energy_end"] = nb::make_tuple(s.energy_end.kinetic, s.energy_end.potential);
  d["energy_work"] = s.energy_work;
  d["energy_gain"] = s.energy_gain;
  d["seconds"] = s.phases.total;
  d["device"] = s.device;
  d["kind"] = s.kind;
  nb::dict values;
  for (const auto& [name, value] : s.values) values[name.c_str()] = value;
  d["values"] = values;
  nb::list envelopes, mode_values;
  const auto extreme = [](const SimulationExtreme& x) {
    nb::dict out;
    out["value"] = x.value;
    out["t"] = x.t;
    if (x.body.empty()) return out;
    out["body"] = x.body;
    if (x.node != 0) out["node"] = x.node;
    out["place"] = nb::make_tuple(x.place[0], x.place[1], x.place[2]);
    return out;
  };
  for (const SimulationEnvelope& e : s.envelopes) {
    nb::dict envelope;
    envelope["quantity"] = e.quantity;
    envelope["largest"] = extreme(e.largest);
    envelope["least"] = extreme(e.least);
    envelopes.append(envelope);
  }
  for (const SimulationMode& m : s.modes) {
    nb::dict of_mode;
    for (const auto& [name, value] : m.values) of_mode[name.c_str()] = value;
    mode_values.append(of_mode);
  }
  d["envelopes"] = envelopes;
  nb::list peaks, paths;
  for (const SimulationExtreme& x : s.stress_peaks) peaks.append(extreme(x));
  for (const SimulationPath& p : s.paths) {
    nb::dict path, columns;
    const std::size_t points = p.length.size();
    for (std::size_t q = 0; q < p.quantities.size(); ++q) {
      const auto from = p.values.begin() + static_cast<std::ptrdiff_t>(q * points);
      columns[p.quantities[q].c_str()] = std::vector<double>(from, from + static_cast<std::ptrdiff_t>(points));
    }
    path["name"] = p.name;
    path["body"] = p.body;
    path["t"] = p.t;
    path["length"] = p.length;
    path["places"] = p.places;
    path["values"] = columns;
    paths.append(path);
  }
  d["stress_peaks"] = peaks;
  d["paths"] = paths;
  d["mode_values"] = mode_values;
  d["files"] = s.files;
  return d;
}

}  // namespace

void bind_simulation(nb::module_& m) {
  nb::class_<SimulationHandle>(m, "Simulation")
      .def(nb::init<std::vector<std::string>, std::string, std::optional<double>, std::string, bool,
                    std::vector<std::string>, std::vector<std::pair<std::string, std::string>>, std::string, double,
                    bool>(),
           "set"_a, "out"_a, "until"_a.none(), "restart"_a, "accept_changes"_a, "quantities"_a, "solver"_a,
           "analyses"_a, "frames"_a, "page"_a)
      .def("page", [](SimulationHandle& s) { return s.look([](Simulation& sim) { return sim.page(); }); })
      .def(
          "load",
          [](SimulationHandle& s, const std::string& text, const std::string& name, bool is_path) {
            return status_of(s.load(text, name, is_path));
          },
          "text"_a, "name"_a, "is_path"_a)
      .def(
          "run", [](SimulationHandle& s, const nb::object& observer) { return status_of(s.run(observer)); },
          "observer"_a.none())
      .def(
          "step_to",
          [](SimulationHandle& s, double t, const nb::object& observer) { return status_of(s.step_to(t, observer)); },
          "t"_a, "observer"_a.none())
      .def("save",
           [](SimulationHandle& s) {
             const std::string bytes = s.look([](Simulation& sim) { return sim.save(); });
             return nb::bytes(bytes.data(), bytes.size());
           })
      .def(
          "restore",
          [](SimulationHandle& s, const nb::bytes& state) {
            const std::string_view bytes(state.c_str(), state.size());
            return status_of(s.restore(bytes));
          },
          "state"_a)
      .def("time", [](SimulationHandle& s) { return s.look([](Simulation& sim) { return sim.time(); }); })
      .def("end_time", [](SimulationHandle& s) { return s.look([](Simulation& sim) { return sim.end_time(); }); })
      .def(
          "value",
          [](SimulationHandle& s, const std::string& quantity) {
            return s.look([&](Simulation& sim) { return sim.value(quantity); });
          },
          "quantity"_a)
      .def("inputs",
           [](SimulationHandle& s) {
             nb::dict d;
             for (const SimulationInput& i : s.look([](Simulation& sim) { return sim.inputs(); }))
               d[i.name.c_str()] = i.value;
             return d;
           })
      .def(
          "set_input",
          [](SimulationHandle& s, const std::string& name, double value) {
            s.look([&](Simulation& sim) {
              sim.set_input(name, value);
              return 0;
            });
          },
          "name"_a, "value"_a)
      .def("quantities",
           [](SimulationHandle& s) {
             nb::dict d;
             for (const SimulationQuantity& q : s.look([](Simulation& sim) { return sim.quantities(); }))
               d[q.name.c_str()] = q.dimension;
             return d;
           })
      .def("series",
           [](SimulationHandle& s) {
             SimulationSeries series = s.look([](Simulation& sim) { return sim.series(); });
             const std::size_t rows = series.t.size(), columns = series.names.size();
             return nb::make_tuple(series.names, array_of(std::move(series.t), {rows}),
                                   array_of(std::move(series.values), {rows, columns}));
           })
      .def("mesh", [](SimulationHandle& s) { return fields(s.look([](Simulation& sim) { return sim.mesh(); })); })
      .def("frame", [](SimulationHandle& s) { return fields(s.look([](Simulation& sim) { return sim.frame(); })); })
      .def("frames",
           [](SimulationHandle& s) {
             nb::list list;
             for (SimulationFrame& f : s.look([](Simulation& sim) { return sim.frames(); }))
               list.append(fields(std::move(f)));
             return list;
           })
      .def("summary",
           [](SimulationHandle& s) { return fields(s.look([](Simulation& sim) { return sim.summary(); })); });
}

}  // namespace espalier::python

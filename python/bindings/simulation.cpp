// The simulator's part of the module _core. Private: espalier/_models/simulation.py gives it types and checks.
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
#include "simulation_summary.hpp"
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

  Status load(const std::string& text, const std::string& name) {
    return turns_.call([&] { return simulation_->load_text(text, name); });
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
  std::invoke_result_t<Body, Simulation&> query(Body&& body) {
    return turns_.query([&] { return body(*simulation_); });
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

}  // namespace

void bind_simulation(nb::module_& m) {
  nb::class_<SimulationHandle>(m, "Simulation")
      .def(nb::init<std::vector<std::string>, std::string, std::optional<double>, std::string, bool,
                    std::vector<std::string>, std::vector<std::pair<std::string, std::string>>, std::string, double,
                    bool>(),
           "set"_a, "out"_a, "until"_a.none(), "restart"_a, "accept_changes"_a, "quantities"_a, "solver"_a,
           "analyses"_a, "frames"_a, "page"_a)
      .def("page", [](SimulationHandle& s) { return s.query([](Simulation& sim) { return sim.page(); }); })
      .def(
          "load",
          [](SimulationHandle& s, const std::string& text, const std::string& name) {
            return status_of(s.load(text, name));
          },
          "text"_a, "name"_a)
      .def(
          "run", [](SimulationHandle& s, const nb::object& observer) { return status_of(s.run(observer)); },
          "observer"_a.none())
      .def(
          "step_to",
          [](SimulationHandle& s, double t, const nb::object& observer) { return status_of(s.step_to(t, observer)); },
          "t"_a, "observer"_a.none())
      .def("save",
           [](SimulationHandle& s) {
             const std::string bytes = s.query([](Simulation& sim) { return sim.save(); });
             return nb::bytes(bytes.data(), bytes.size());
           })
      .def(
          "restore",
          [](SimulationHandle& s, const nb::bytes& state) {
            const std::string_view bytes(state.c_str(), state.size());
            return status_of(s.restore(bytes));
          },
          "state"_a)
      .def("time", [](SimulationHandle& s) { return s.query([](Simulation& sim) { return sim.time(); }); })
      .def("end_time", [](SimulationHandle& s) { return s.query([](Simulation& sim) { return sim.end_time(); }); })
      .def(
          "value",
          [](SimulationHandle& s, const std::string& quantity) {
            return s.query([&](Simulation& sim) { return sim.value(quantity); });
          },
          "quantity"_a)
      .def("inputs",
           [](SimulationHandle& s) {
             nb::dict d;
             for (const SimulationInput& i : s.query([](Simulation& sim) { return sim.inputs(); }))
               d[i.name.c_str()] = i.value;
             return d;
           })
      .def(
          "set_input",
          [](SimulationHandle& s, const std::string& name, double value) {
            s.query([&](Simulation& sim) {
              sim.set_input(name, value);
              return 0;
            });
          },
          "name"_a, "value"_a)
      .def("quantities",
           [](SimulationHandle& s) {
             nb::dict d;
             for (const SimulationQuantity& q : s.query([](Simulation& sim) { return sim.quantities(); }))
               d[q.name.c_str()] = q.dimension;
             return d;
           })
      .def("units",
           [](SimulationHandle& s) {
             nb::dict d;
             for (const SimulationQuantity& q : s.query([](Simulation& sim) { return sim.quantities(); }))
               if (!q.unit.empty()) d[q.name.c_str()] = q.unit;
             return d;
           })
      .def("series",
           [](SimulationHandle& s) {
             SimulationSeries series = s.query([](Simulation& sim) { return sim.series(); });
             const std::size_t rows = series.t.size(), columns = series.names.size();
             return nb::make_tuple(series.names, array_of(std::move(series.t), {rows}),
                                   array_of(std::move(series.values), {rows, columns}));
           })
      .def("mesh", [](SimulationHandle& s) { return fields(s.query([](Simulation& sim) { return sim.mesh(); })); })
      .def("frame", [](SimulationHandle& s) { return fields(s.query([](Simulation& sim) { return sim.frame(); })); })
      .def("frames",
           [](SimulationHandle& s) {
             nb::list list;
             for (SimulationFrame& f : s.query([](Simulation& sim) { return sim.frames(); }))
               list.append(fields(std::move(f)));
             return list;
           })
      .def("summary",
           [](SimulationHandle& s) { return summary_dict(s.query([](Simulation& sim) { return sim.summary(); })); });
}

}  // namespace espalier::python

// Derivatives of simulations. Private: espalier/_models/sensitivities.py gives them types and exceptions.
#include "espalier/sensitivities.hpp"

#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <limits>
#include <optional>
#include <stdexcept>
#include <utility>

#include "arrays.hpp"
#include "bindings.hpp"
#include "host.hpp"

namespace espalier::python {

namespace {

using namespace nb::literals;

// Status, and the fields in the order of the dataclass in _sensitivities.py.
nb::tuple fields(SensitivityResult r) {
  const nb::tuple status = status_of(r.status);
  if (!r.status.ok()) return nb::make_tuple(status, nb::none());
  const std::size_t steps = r.t.size(), nq = r.quantities.size(), np = r.parameters.size();
  const std::size_t modes = r.modes.frequencies.size();
  for (std::string& notice : r.summary.notices) notice = python_words(std::move(notice));
  return nb::make_tuple(status,
                        nb::make_tuple(r.parameters, array_of(std::move(r.parameter_values), {np}), r.quantities,
                                       array_of(std::move(r.t), {steps}), array_of(std::move(r.values), {steps, nq}),
                                       array_of(std::move(r.derivatives), {steps, nq, np}),
                                       array_of(std::move(r.modes.frequencies), {modes}),
                                       array_of(std::move(r.modes.derivatives), {modes, np}), r.defect, r.adjoint,
                                       std::move(r.summary.notices)));
}

SensitivityMethod method_named(const std::string& name) {
  if (name == "auto") return SensitivityMethod::automatic;
  if (name == "forward") return SensitivityMethod::forward;
  if (name == "adjoint") return SensitivityMethod::adjoint;
  throw std::invalid_argument("method '" + name + "': known are auto, forward, adjoint");
}

// objective(t, values of shape (T, Q)) -> (number, T x Q slopes in a flat array). What it raises is raised in the end.
SensitivityObjective told(const nb::object& objective) {
  return [&objective](const std::vector<double>& t, const std::vector<double>& values, std::vector<double>& slopes) {
    const nb::gil_scoped_acquire gil;
    try {
      const std::size_t rows = t.size();
      const nb::object answer = objective(array_of(std::vector<double>(t), {rows}),
                                          array_of(std::vector<double>(values), {rows, values.size() / rows}));
      const auto [value, by_values] =
          nb::cast<std::pair<double, nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>>>(answer);
      slopes.assign(by_values.data(), by_values.data() + by_values.size());
      return value;
    } catch (...) {
      Host::raised = std::current_exception();
      return std::numeric_limits<double>::quiet_NaN();
    }
  };
}

}  // namespace

void bind_sensitivities(nb::module_& m) {
  m.def(
      "sensitivities",
      [](const std::string& text, const std::string& name,
         const std::vector<std::pair<std::string, double>>& parameters, std::vector<std::string> set,
         std::optional<double> until, std::vector<std::string> quantities,
         std::vector<std::pair<std::string, std::string>> solver, const std::string& method,
         const nb::object& objective) {
        SimulationOptions o;
        o.set = std::move(set);
        o.until = until;
        o.quantities = std::move(quantities);
        o.solver = std::move(solver);
        o.interrupted = &Host::interrupted;
        o.interrupted_every = 0.1;
        std::vector<SensitivityParameter> list;
        for (const auto& [path, step] : parameters) list.push_back({path, step});
        SensitivityResult result;
        {
          const nb::gil_scoped_release released;
          if (!objective.is_none())
            result = objective_gradient_of_text(text, name, list, told(objective), o);
          else
            result = sensitivities_of_text(text, name, list, o, method_named(method));
        }
        if (Host::raised) std::rethrow_exception(std::exchange(Host::raised, nullptr));
        return fields(std::move(result));
      },
      "text"_a, "name"_a, "parameters"_a, "set"_a, "until"_a.none(), "quantities"_a, "solver"_a, "method"_a,
      "objective"_a.none());
}

}  // namespace espalier::python

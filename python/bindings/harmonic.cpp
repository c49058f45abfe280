// Frequency responses. Private: espalier/_pencils/harmonic.py gives them types, checks and exceptions.
#include "espalier/harmonic.hpp"

#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <utility>

#include "arrays.hpp"
#include "bindings.hpp"
#include "espalier/model_harmonic.hpp"
#include "espalier/model_modes.hpp"
#include "pencil.hpp"

namespace espalier::python {

namespace {

using namespace nb::literals;

// Complex numbers as pairs: numpy sees them as such.
std::vector<double> pairs(const std::vector<std::complex<double>>& x) {
  std::vector<double> out;
  out.reserve(2 * x.size());
  for (const std::complex<double>& z : x) {
    out.push_back(z.real());
    out.push_back(z.imag());
  }
  return out;
}

HarmonicOptions options_of(const nb::dict& given) {
  HarmonicOptions o;
  o.from = nb::cast<double>(given["from"]);
  o.to = nb::cast<double>(given["to"]);
  o.points = nb::cast<Index>(given["points"]);
  o.logarithmic = nb::cast<bool>(given["logarithmic"]);
  o.frequencies = nb::cast<std::vector<double>>(given["frequencies"]);
  o.tolerance = nb::cast<double>(given["tolerance"]);
  o.max_solves = nb::cast<Index>(given["max_solves"]);
  o.seek_resonances = nb::cast<bool>(given["seek_resonances"]);
  o.loss_factor = nb::cast<double>(given["loss_factor"]);
  o.observed = nb::cast<std::vector<Index>>(given["observed"]);
  o.shapes_at = nb::cast<std::vector<double>>(given["shapes_at"]);
  return o;
}

// The fields in the order of the dataclass in _harmonic.py: loads outside, outputs and unknowns inside.
nb::tuple fields(const HarmonicResult& r) {
  const std::size_t points = r.points.size(), loads = static_cast<std::size_t>(r.loads),
                    outputs = static_cast<std::size_t>(r.outputs), n = static_cast<std::size_t>(r.n);
  std::vector<double> frequencies, backward, estimates, resonances;
  std::vector<std::uint8_t> solved;
  for (const HarmonicPoint& p : r.points) {
    frequencies.push_back(p.frequency);
    solved.push_back(p.solved ? 1 : 0);
    backward.push_back(p.backward_error);
    estimates.push_back(p.error_estimate);
  }
  for (const HarmonicResonance& x : r.resonances)
    resonances.insert(resonances.end(), {x.frequency, x.half_width, x.excited ? 1.0 : 0.0});
  nb::dict seconds;
  seconds["total"] = r.seconds.total;
  seconds["modes"] = r.seconds.modes;
  seconds["analysis"] = r.seconds.analysis;
  seconds["factorization"] = r.seconds.factorization;
  seconds["solves"] = r.seconds.solves;
  seconds["interpolation"] = r.seconds.interpolation;
  const std::size_t shapes = r.shape_frequencies.size(), found = r.resonances.size();
  std::vector<double> shape_frequencies = r.shape_frequencies;
  return nb::make_tuple(array_of(std::move(frequencies), {points}),
                        array_of(pairs(r.responses), {points, loads, outputs, 2}),
                        array_of(std::move(solved), {points}), array_of(std::move(backward), {points}),
                        array_of(std::move(estimates), {points}), array_of(std::move(shape_frequencies), {shapes}),
                        array_of(pairs(r.shapes), {shapes, loads, n, 2}), array_of(std::move(resonances), {found, 3}),
                        r.complete, r.completeness, r.checked_error, r.factorizations, seconds);
}

}  // namespace

void bind_harmonic(nb::module_& m) {
  const auto array = [](const char* name) { return nb::arg(name).noconvert(); };
  m.def(
      "harmonic",
      [](const Pointers& kp, const Indices& ki, const Values& kv, const Pointers& cp, const Indices& ci,
         const Values& cv, const Pointers& mp, const Indices& mi, const Values& mv, int storage, bool damped,
         const Values& loads, Index columns, const nb::dict& options,
         const std::vector<std::pair<std::string, std::string>>& solver, nb::object log) {
        Host host{std::move(log)};
        HarmonicOptions o = options_of(options);
        o.solver = pencil_solver(solver);
        o.solver.log = [&host](const std::string& line) { host.write(line); };
        const MatrixView k = view_of(kp, ki, kv, storage), mass = view_of(mp, mi, mv, storage);
        const MatrixView c = damped ? view_of(cp, ci, cv, storage) : MatrixView{};
        const auto* first = reinterpret_cast<const std::complex<double>*>(loads.data());
        HarmonicResult r;
        {
          const nb::gil_scoped_release released;
          r = harmonic_response(k, c, mass, {first, loads.size() / 2}, columns, o);
        }
        if (Host::raised) std::rethrow_exception(std::exchange(Host::raised, nullptr));
        return nb::make_tuple(status_of(r.status), fields(r));
      },
      array("k_pointers"), array("k_indices"), array("k_values"), array("c_pointers"), array("c_indices"),
      array("c_values"), array("m_pointers"), array("m_indices"), array("m_values"), "storage"_a, "damped"_a,
      array("loads"), "columns"_a, "options"_a, "solver"_a, "log"_a.none());
  m.def(
      "model_harmonic",
      [](const std::string& text, const std::string& name, std::vector<std::string> set, std::string out,
         std::vector<std::pair<std::string, std::string>> solver) {
        SimulationOptions o;
        o.set = std::move(set);
        o.out = std::move(out);
        o.solver = std::move(solver);
        o.interrupted = &Host::interrupted;
        o.interrupted_every = 0.1;
        ModelHarmonicResult r;
        {
          const nb::gil_scoped_release released;
          r = model_harmonic_of_text(text, name, o);
        }
        if (Host::raised) std::rethrow_exception(std::exchange(Host::raised, nullptr));
        return nb::make_tuple(status_of(r.status), fields(r.response), r.quantities, r.loads, r.notices);
      },
      "text"_a, "name"_a, "set"_a, "out"_a, "solver"_a);
  m.def(
      "model_modes",
      [](const std::string& text, const std::string& name, const std::string& number, const std::vector<double>& values,
         int count, std::vector<std::string> set, std::vector<std::pair<std::string, std::string>> solver) {
        SimulationOptions o;
        o.set = std::move(set);
        o.solver = std::move(solver);
        o.interrupted = &Host::interrupted;
        o.interrupted_every = 0.1;
        ModelModesResult r;
        {
          const nb::gil_scoped_release released;
          r = model_modes_of_text(text, name, number, values, count, o);
        }
        if (Host::raised) std::rethrow_exception(std::exchange(Host::raised, nullptr));
        nb::list rows, notices;
        for (const ModelModesPoint& p : r.points) {
          for (std::size_t k = 0; k < p.modes.size(); ++k) {
            const SimulationMode& mode = p.modes[k];
            rows.append(nb::make_tuple(p.value, k + 1, mode.frequency, mode.damping_ratio, mode.growth, mode.whirl,
                                       mode.standing_frequency));
          }
          for (const std::string& notice : p.notices) notices.append(nb::make_tuple(p.value, notice));
        }
        return nb::make_tuple(status_of(r.status), rows, notices);
      },
      "text"_a, "name"_a, "number"_a, "values"_a, "count"_a, "set"_a, "solver"_a);
}

}  // namespace espalier::python

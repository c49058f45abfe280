// Modes of pencils. Private: espalier/_pencils/modes.py gives them types, checks and exceptions.
#include "espalier/modes.hpp"

#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <utility>

#include "arrays.hpp"
#include "bindings.hpp"
#include "pencil.hpp"

namespace espalier::python {

namespace {

using namespace nb::literals;

ModesOptions options_of(const nb::dict& given, const std::vector<std::pair<std::string, std::string>>& solver,
                        Host& host) {
  ModesOptions o;
  o.solver = pencil_solver(solver);
  o.solver.log = [&host](const std::string& line) { host.write(line); };
  o.count = nb::cast<Index>(given["count"]);
  o.below = nb::cast<double>(given["below"]);
  o.shift = nb::cast<double>(given["shift"]);
  o.tolerance = nb::cast<double>(given["tolerance"]);
  o.block_size = nb::cast<Index>(given["block_size"]);
  o.basis_size = nb::cast<Index>(given["basis_size"]);
  o.seed = nb::cast<std::uint64_t>(given["seed"]);
  o.prove = nb::cast<bool>(given["prove"]);
  o.check_mass = nb::cast<bool>(given["check_mass"]);
  return o;
}

nb::dict seconds_of(const ModesSeconds& s) {
  nb::dict d;
  d["total"] = s.total;
  d["mass"] = s.mass;
  d["analysis"] = s.analysis;
  d["factorization"] = s.factorization;
  d["solves"] = s.solves;
  d["orthogonalization"] = s.orthogonalization;
  d["products"] = s.products;
  return d;
}

// Status, and the fields in the order of the dataclass in _modes.py. Vectors row by row.
nb::tuple fields(ModesResult r) {
  const auto count = static_cast<std::size_t>(r.count());
  nb::list counts;
  for (const ModeCount& c : r.counts) counts.append(nb::make_tuple(c.at, c.below));
  const auto numbers = [&](std::vector<double>& v) {
    v.resize(count);  // of a search that was stopped, not all are known
    return array_of(std::move(v), {count});
  };
  r.vectors.resize(count * static_cast<std::size_t>(r.n));
  const nb::tuple status = status_of(r.status);
  return nb::make_tuple(
      status,
      nb::make_tuple(numbers(r.eigenvalues), array_of(std::move(r.vectors), {count, static_cast<std::size_t>(r.n)}),
                     numbers(r.residuals), numbers(r.error_bounds), r.orthogonality, r.complete, r.completeness,
                     r.finite, r.massless, nb::tuple(counts), r.factorizations, r.solved_columns, r.restarts,
                     r.peak_bytes, seconds_of(r.seconds)));
}

}  // namespace

void bind_modes(nb::module_& m) {
  const auto array = [](const char* name) { return nb::arg(name).noconvert(); };
  m.def(
      "find_modes",
      [](const Pointers& kp, const Indices& ki, const Values& kv, const Pointers& mp, const Indices& mi,
         const Values& mv, int storage, bool buckling, const nb::dict& options,
         const std::vector<std::pair<std::string, std::string>>& solver, nb::object log) {
        Host host{std::move(log)};
        const ModesOptions o = options_of(options, solver, host);
        const MatrixView k = view_of(kp, ki, kv, storage), second = view_of(mp, mi, mv, storage);
        ModesResult result;
        {
          const nb::gil_scoped_release released;
          result = buckling ? find_buckling_modes(k, second, o) : find_modes(k, second, o);
        }
        if (Host::raised) std::rethrow_exception(std::exchange(Host::raised, nullptr));
        return fields(std::move(result));
      },
      array("k_pointers"), array("k_indices"), array("k_values"), array("m_pointers"), array("m_indices"),
      array("m_values"), "storage"_a, "buckling"_a, "options"_a, "solver"_a, "log"_a.none());
  m.def(
      "find_quadratic_modes",
      [](const Pointers& kp, const Indices& ki, const Values& kv, const Pointers& cp, const Indices& ci,
         const Values& cv, const Pointers& mp, const Indices& mi, const Values& mv, int storage, Index count,
         double shift, double tolerance, Index basis_size,
         const std::vector<std::pair<std::string, std::string>>& solver) {
        QuadraticModesOptions o;
        o.solver = pencil_solver(solver);
        o.count = count;
        o.shift = shift;
        o.tolerance = tolerance;
        o.basis_size = basis_size;
        const MatrixView k = view_of(kp, ki, kv, storage), c = view_of(cp, ci, cv, storage),
                         second = view_of(mp, mi, mv, storage);
        QuadraticModesResult r;
        {
          const nb::gil_scoped_release released;
          r = find_quadratic_modes(k, c, second, o);
        }
        if (Host::raised) std::rethrow_exception(std::exchange(Host::raised, nullptr));
        // Complex numbers as pairs: numpy sees them as such.
        const auto found = static_cast<std::size_t>(r.count()), n = static_cast<std::size_t>(r.n);
        std::vector<double> values, vectors;
        for (const auto& l : r.eigenvalues) values.insert(values.end(), {l.real(), l.imag()});
        for (const auto& x : r.vectors) vectors.insert(vectors.end(), {x.real(), x.imag()});
        return nb::make_tuple(status_of(r.status), array_of(std::move(values), {found, 2}),
                              array_of(std::move(vectors), {found, n, 2}), array_of(std::move(r.residuals), {found}),
                              r.shift, r.solved_columns);
      },
      array("k_pointers"), array("k_indices"), array("k_values"), array("c_pointers"), array("c_indices"),
      array("c_values"), array("m_pointers"), array("m_indices"), array("m_values"), "storage"_a, "count"_a, "shift"_a,
      "tolerance"_a, "basis_size"_a, "solver"_a);
}

}  // namespace espalier::python

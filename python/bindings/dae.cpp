// Systems of Python's functions: the generic layer of the simulator. Private: espalier/_models/dae.py gives it types
// and checks.
#include "espalier/dae.hpp"

#include <nanobind/ndarray.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <functional>
#include <memory>
#include <span>
#include <stdexcept>
#include <tuple>
#include <type_traits>
#include <utility>

#include "arrays.hpp"
#include "bindings.hpp"
#include "dynamics/model/run/newton_solver.hpp"
#include "host.hpp"
#include "turns.hpp"

namespace espalier::python {

namespace {

using namespace nb::literals;

using Vector = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Places = nb::ndarray<const Index, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using ConstSpan = std::span<const double>;

// A copy: the library's arrays are there during the call only, Python may keep what it is given.
nb::object vector_of(ConstSpan x) { return array_of(std::vector<double>(x.begin(), x.end()), {x.size()}); }

// What a function of Python returned, to where the library wants it. _dae.py has checked types and sizes.
void take(const nb::object& answer, std::span<double> out) {
  const auto numbers = nb::cast<Vector>(answer);
  if (numbers.size() != out.size()) throw std::logic_error("espalier.Dae: a vector of another size");
  std::copy_n(numbers.data(), out.size(), out.begin());
}

void take(const nb::object& answer, MatrixEntries out) {
  const auto [rows, columns, values] = nb::cast<std::tuple<Places, Places, Vector>>(answer);
  for (std::size_t k = 0; k < values.size(); ++k) out(rows.data()[k], columns.data()[k]) += values.data()[k];
}

nb::tuple state_of(const StateView& s) {
  return nb::make_tuple(s.t, vector_of(s.q), vector_of(s.v), vector_of(s.a), vector_of(s.lambda));
}

// What the library hands to a function, as Python's arguments.
void append(nb::list& to, double x) { to.append(x); }
void append(nb::list& to, ConstSpan x) { to.append(vector_of(x)); }
void append(nb::list& to, const StateView& s) { to.extend(state_of(s)); }
void append(nb::list& to, const TangentWeights& w) { to.extend(nb::make_tuple(w.a, w.v, w.q)); }

// The function of that name, where one was given: its last argument is where the answer goes.
template <class... Args>
void connect(std::function<void(Args...)>& f, const nb::dict& functions, const char* name) {
  if (!functions.contains(name)) return;
  f = [call = nb::object(functions[name])](Args... args) {
    const nb::gil_scoped_acquire gil;
    const auto all = std::forward_as_tuple(args...);
    [&]<std::size_t... I>(std::index_sequence<I...>) {
      nb::list in;
      (append(in, std::get<I>(all)), ...);
      take(call(*in), std::get<sizeof...(I)>(all));
    }
    (std::make_index_sequence<sizeof...(Args) - 1>{});
  };
}

DaeFunctions functions_of(Index n, Index m, const nb::dict& given) {
  DaeFunctions f;
  f.coordinates = n;
  f.constraints = m;
  connect(f.mass, given, "mass");
  connect(f.force, given, "force");
  connect(f.residual, given, "residual");
  connect(f.tangent, given, "tangent");
  connect(f.constraint, given, "constraint");
  connect(f.constraint_jacobian, given, "constraint_jacobian");
  connect(f.constraint_rate, given, "constraint_rate");
  connect(f.constraint_gamma, given, "constraint_gamma");
  if (given.contains("energy"))
    f.energy = [call = nb::object(given["energy"])](const StateView& s) {
      const nb::gil_scoped_acquire gil;
      const auto [kinetic, potential] = nb::cast<std::pair<double, double>>(call(*state_of(s)));
      return Energy{kinetic, potential};
    };
  return f;
}

// Options that are numbers, by name.
constexpr std::pair<const char*, int DaeOptions::*> kWhole[] = {
    {"max_order", &DaeOptions::max_order}, {"order", &DaeOptions::order}, {"max_newton", &DaeOptions::max_newton}};
constexpr std::pair<const char*, double DaeOptions::*> kNumbers[] = {
    {"relative", &DaeOptions::relative},
    {"absolute", &DaeOptions::absolute},
    {"absolute_velocity", &DaeOptions::absolute_velocity},
    {"step", &DaeOptions::step},
    {"initial_step", &DaeOptions::initial_step},
    {"min_step", &DaeOptions::min_step},
    {"max_step", &DaeOptions::max_step},
    {"spectral_radius", &DaeOptions::spectral_radius},
    {"constraint_tolerance", &DaeOptions::constraint_tolerance},
    {"newton_tolerance", &DaeOptions::newton_tolerance},
    {"newton_change", &DaeOptions::newton_change},
    {"refactor_rate", &DaeOptions::refactor_rate},
    {"refactor_step", &DaeOptions::refactor_step},
    {"allowed_position", &DaeOptions::allowed_position},
    {"allowed_velocity", &DaeOptions::allowed_velocity}};

DaeOptions options_of(const nb::dict& given, const std::vector<std::pair<std::string, std::string>>& solver,
                      Index unknowns) {
  DaeOptions o;
  const auto set = [&o](const auto& table, const std::string& name, double value) {
    for (const auto& [known, member] : table)
      if (name == known) {
        o.*member = static_cast<std::remove_reference_t<decltype(o.*member)>>(value);
        return true;
      }
    return false;
  };
  for (const auto& [key, given_value] : given) {
    const auto name = nb::cast<std::string>(key);
    const auto value = nb::cast<double>(given_value);
    if (name == "generalized_alpha")
      o.method = value != 0 ? DaeMethod::generalized_alpha : DaeMethod::bdf;
    else if (name == "test_velocity")
      o.test_velocity = value != 0;
    else if (name == "hht_alpha")
      o.hht_alpha = value;
    else if (!set(kWhole, name, value) && !set(kNumbers, name, value))
      throw std::invalid_argument("there is no option '" + name + "'");
  }
  if (!solver.empty()) o.solver = dynamics::model::run_options(solver, unknowns);
  return o;
}

// A system with a lock; functions take the global lock when they are called.
class DaeHandle {
 public:
  DaeHandle(Index n, Index m, const nb::dict& functions, const nb::dict& options,
            const std::vector<std::pair<std::string, std::string>>& solver, std::vector<std::string> names,
            std::vector<std::pair<Index, Index>> tangent_pattern,
            std::vector<std::pair<Index, Index>> constraint_pattern) {
    DaeFunctions f = functions_of(n, m, functions);
    f.constraint_names = std::move(names);
    f.tangent_pattern = std::move(tangent_pattern);
    f.constraint_pattern = std::move(constraint_pattern);
    dae_ = std::make_unique<Dae>(std::move(f), options_of(options, solver, n + m));
  }

  Status start(double t, const Vector& q, const Vector& v) {
    return turns_.call([&] { return dae_->start(t, {q.data(), q.size()}, {v.data(), v.size()}); });
  }
  Status integrate(double end, const nb::object& observer) {
    return turns_.call([&] {
      return dae_->integrate(end, [&](const DaeStep& s) {
        if (Host::interrupted()) return false;
        if (observer.is_none()) return true;
        const nb::gil_scoped_acquire gil;
        const nb::object answer = observer(
            nb::make_tuple(s.index, s.t, s.h, s.order, s.newton_iterations, s.factorizations, s.error, s.rounding));
        return goes_on(answer);
      });
    });
  }
  Energy energy() {
    return turns_.call([&] { return dae_->energy(); });
  }
  JacobianCheck check_jacobians() {
    return turns_.call([&] { return dae_->check_jacobians(); });
  }
  // Also from the system's own functions and observer.
  nb::tuple state() {
    return turns_.query([&] {
      const nb::gil_scoped_acquire gil;
      return state_of(dae_->state());
    });
  }
  DaeSummary summary() {
    return turns_.query([&] { return dae_->summary(); });
  }

 private:
  std::unique_ptr<Dae> dae_;
  Turns turns_{"a system was used from its own functions"};
};

nb::dict fields(const DaeSummary& s) {
  nb::dict d;
  d["steps"] = s.steps;
  d["newton_iterations"] = s.newton_iterations;
  d["error_failures"] = s.error_failures;
  d["newton_failures"] = s.newton_failures;
  d["residuals"] = s.residuals;
  d["tangents"] = s.tangents;
  d["analyses"] = s.analyses;
  d["factorizations"] = s.factorizations;
  d["solves"] = s.solves;
  d["largest_position"] = s.largest_position;
  d["largest_velocity"] = s.largest_velocity;
  d["largest_acceleration"] = s.largest_acceleration;
  d["degrees_of_freedom"] = s.degrees_of_freedom;
  d["redundant"] = s.redundant;
  return d;
}

nb::dict fields(const JacobianCheck& c) {
  nb::dict d;
  d["f_a"] = c.f_a;
  d["f_v"] = c.f_v;
  d["f_q"] = c.f_q;
  d["phi_q"] = c.phi_q;
  d["nu"] = c.nu;
  d["gamma"] = c.gamma;
  d["largest"] = c.largest();
  d["worst"] = c.worst;
  return d;
}

}  // namespace

void bind_dae(nb::module_& m) {
  nb::class_<DaeHandle>(m, "Dae")
      .def(nb::init<Index, Index, const nb::dict&, const nb::dict&,
                    const std::vector<std::pair<std::string, std::string>>&, std::vector<std::string>,
                    std::vector<std::pair<Index, Index>>, std::vector<std::pair<Index, Index>>>(),
           "coordinates"_a, "constraints"_a, "functions"_a, "options"_a, "solver"_a, "names"_a, "tangent_pattern"_a,
           "constraint_pattern"_a)
      .def(
          "start", [](DaeHandle& d, double t, const Vector& q, const Vector& v) { return status_of(d.start(t, q, v)); },
          "t"_a, "q"_a, "v"_a)
      .def(
          "integrate",
          [](DaeHandle& d, double end, const nb::object& observer) { return status_of(d.integrate(end, observer)); },
          "end"_a, "observer"_a.none())
      .def("state", &DaeHandle::state)
      .def("energy",
           [](DaeHandle& d) {
             const Energy e = d.energy();
             return nb::make_tuple(e.kinetic, e.potential);
           })
      .def("check_jacobians", [](DaeHandle& d) { return fields(d.check_jacobians()); })
      .def("summary", [](DaeHandle& d) { return fields(d.summary()); });
}

}  // namespace espalier::python

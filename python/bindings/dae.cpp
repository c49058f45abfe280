// Systems of Python's functions: the generic layer of the simulator. Private: espalier/_dae.py gives it types and
// checks.
#include "espalier/dae.hpp"

#include <nanobind/ndarray.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <mutex>
#include <span>
#include <stdexcept>
#include <thread>
#include <tuple>
#include <type_traits>
#include <utility>

#include "arrays.hpp"
#include "bindings.hpp"
#include "dynamics/model/newton_solver.hpp"
#include "host.hpp"

namespace espalier::python {

namespace {

using namespace nb::literals;

using Vector = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Places = nb::ndarray<const Index, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using ConstSpan = std::span<const double>;

// A copy: the library's arrays are there during the call only, Python may keep what it is given.
nb::object vector_of(ConstSpan x) { return array_of({x.begin(), x.end()}, {x.size()}); }

// What a function of Python returned, to where the library wants it. _dae.py has checked types and sizes.
void take(const nb::object& answer, std::span<double> out) {
  const auto numbers = nb::cast<Vector>(answer);
  if (numbers.size() != out.size()) throw std::logic_error("espalier._dae: a vector of another size");
  std::copy_n(numbers.data(), out.size(), out.begin());
}

void take(const nb::object& answer, MatrixEntries out) {
  const auto [rows, columns, values] = nb::cast<std::tuple<Places, Places, Vector>>(answer);
  for (std::size_t k = 0; k < values.size(); ++k) out(rows.data()[k], columns.data()[k]) += values.data()[k];
}

nb::tuple state_of(const StateView& s) {
  return nb::make_tuple(s.t, vector_of(s.q), vector_of(s.v), vector_of(s.a), vector_of(s.lambda));
}

// The function of that name; None: it was not given.
nb::object function_of(const nb::dict& functions, const char* name) {
  return functions.contains(name) ? nb::object(functions[name]) : nb::none();
}

DaeFunctions functions_of(Index n, Index m, const nb::dict& given) {
  DaeFunctions f;
  f.coordinates = n;
  f.constraints = m;
  if (const nb::object call = function_of(given, "mass"); !call.is_none())
    f.mass = [call](ConstSpan q, MatrixEntries out) {
      const nb::gil_scoped_acquire gil;
      take(call(vector_of(q)), out);
    };
  if (const nb::object call = function_of(given, "force"); !call.is_none())
    f.force = [call](double t, ConstSpan q, ConstSpan v, std::span<double> out) {
      const nb::gil_scoped_acquire gil;
      take(call(t, vector_of(q), vector_of(v)), out);
    };
  if (const nb::object call = function_of(given, "residual"); !call.is_none())
    f.residual = [call](const StateView& s, std::span<double> out) {
      const nb::gil_scoped_acquire gil;
      take(call(*state_of(s)), out);
    };
  if (const nb::object call = function_of(given, "tangent"); !call.is_none())
    f.tangent = [call](const StateView& s, const TangentWeights& w, MatrixEntries out) {
      const nb::gil_scoped_acquire gil;
      take(call(*state_of(s), w.a, w.v, w.q), out);
    };
  if (const nb::object call = function_of(given, "constraint"); !call.is_none())
    f.constraint = [call](double t, ConstSpan q, std::span<double> out) {
      const nb::gil_scoped_acquire gil;
      take(call(t, vector_of(q)), out);
    };
  if (const nb::object call = function_of(given, "constraint_jacobian"); !call.is_none())
    f.constraint_jacobian = [call](double t, ConstSpan q, MatrixEntries out) {
      const nb::gil_scoped_acquire gil;
      take(call(t, vector_of(q)), out);
    };
  if (const nb::object call = function_of(given, "constraint_rate"); !call.is_none())
    f.constraint_rate = [call](double t, ConstSpan q, std::span<double> out) {
      const nb::gil_scoped_acquire gil;
      take(call(t, vector_of(q)), out);
    };
  if (const nb::object call = function_of(given, "constraint_gamma"); !call.is_none())
    f.constraint_gamma = [call](double t, ConstSpan q, ConstSpan v, std::span<double> out) {
      const nb::gil_scoped_acquire gil;
      take(call(t, vector_of(q), vector_of(v)), out);
    };
  if (const nb::object call = function_of(given, "energy"); !call.is_none())
    f.energy = [call](const StateView& s) {
      const nb::gil_scoped_acquire gil;
      const auto [kinetic, potential] = nb::cast<std::pair<double, double>>(call(*state_of(s)));
      return Energy{kinetic, potential};
    };
  return f;
}

DaeOptions options_of(const nb::dict& given, const std::vector<std::pair<std::string, std::string>>& solver,
                      Index unknowns) {
  DaeOptions o;
  for (const auto& [key, value] : given) {
    const auto name = nb::cast<std::string>(key);
    const auto number = [&, value = nb::object(nb::borrow(value))] { return nb::cast<double>(value); };
    const auto whole = [&] { return static_cast<int>(number()); };
    if (name == "generalized_alpha")
      o.method = number() != 0 ? DaeMethod::generalized_alpha : DaeMethod::bdf;
    else if (name == "test_velocity")
      o.test_velocity = number() != 0;
    else if (name == "max_order")
      o.max_order = whole();
    else if (name == "order")
      o.order = whole();
    else if (name == "max_newton")
      o.max_newton = whole();
    else if (name == "hht_alpha")
      o.hht_alpha = number();
    else if (name == "relative")
      o.relative = number();
    else if (name == "absolute")
      o.absolute = number();
    else if (name == "absolute_velocity")
      o.absolute_velocity = number();
    else if (name == "step")
      o.step = number();
    else if (name == "initial_step")
      o.initial_step = number();
    else if (name == "min_step")
      o.min_step = number();
    else if (name == "max_step")
      o.max_step = number();
    else if (name == "spectral_radius")
      o.spectral_radius = number();
    else if (name == "constraint_tolerance")
      o.constraint_tolerance = number();
    else if (name == "newton_tolerance")
      o.newton_tolerance = number();
    else if (name == "allowed_position")
      o.allowed_position = number();
    else if (name == "allowed_velocity")
      o.allowed_velocity = number();
    else
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
    return call([&] { return dae_->start(t, {q.data(), q.size()}, {v.data(), v.size()}); });
  }
  Status integrate(double end, const nb::object& observer) {
    return call([&] {
      return dae_->integrate(end, [&](const DaeStep& s) {
        if (Host::signals_raise()) return false;
        if (observer.is_none()) return true;
        const nb::gil_scoped_acquire gil;
        const nb::object answer = observer(
            nb::make_tuple(s.index, s.t, s.h, s.order, s.newton_iterations, s.factorizations, s.error, s.rounding));
        return goes_on(answer);
      });
    });
  }
  Dae& dae() { return *dae_; }
  template <class Body>
  std::invoke_result_t<Body> call(Body&& body) {
    if (owner_ == std::this_thread::get_id()) throw std::logic_error("a system was used from its own functions");
    std::invoke_result_t<Body> result;
    {
      const nb::gil_scoped_release released;
      const std::lock_guard lock(mutex_);
      owner_ = std::this_thread::get_id();
      struct Leave {
        std::atomic<std::thread::id>& owner;
        ~Leave() { owner = std::thread::id{}; }
      } const leave{owner_};
      result = body();
    }
    if (Host::raised) std::rethrow_exception(std::exchange(Host::raised, nullptr));
    return result;
  }

 private:
  std::unique_ptr<Dae> dae_;
  std::mutex mutex_;
  std::atomic<std::thread::id> owner_{};
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
      .def("state", [](DaeHandle& d) { return state_of(d.dae().state()); })
      .def("energy",
           [](DaeHandle& d) {
             const Energy e = d.call([&] { return d.dae().energy(); });
             return nb::make_tuple(e.kinetic, e.potential);
           })
      .def("check_jacobians", [](DaeHandle& d) { return fields(d.call([&] { return d.dae().check_jacobians(); })); })
      .def("summary", [](DaeHandle& d) { return fields(d.dae().summary()); });
}

}  // namespace espalier::python

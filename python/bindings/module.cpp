#include <new>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

#include "bindings.hpp"
#include "espalier/types.hpp"

// An Error that leaves C++ becomes espalier.Error by its status: _errors.py sets the function that makes one.
namespace espalier::python {

std::string python_words(std::string message) {
  static constexpr std::pair<const char*, const char*> kNames[] = {
      {"ComplexSolver::", "Solver::"},
      {"Solver::refactorize_device", "Solver.factorize"},
      {"Solver::refactorize_entries", "Solver.factorize_entries"},
      {"Solver::refactorize", "Solver.factorize"},
      {"Solver::solve_device", "Solver.solve"},
      {"Solver::condition_estimate", "Solver.condition"},
      {", or name it (--library PATH, FmuOptions::library)", ""},
      {"(--outputs hinge.angle)", "(outputs=[\"hinge.angle\"])"},
      {"SensitivityParameter::step", "parameters={path: step}"},
      {"or SimulationOptions", "or in quantities=[...]"},
      {"DaeOptions::", ""},
      {"Options::", ""},
      {"::", "."}};
  for (const auto& [ours, theirs] : kNames)
    for (std::size_t at = message.find(ours); at != std::string::npos; at = message.find(ours, at))
      message.replace(at, std::string_view(ours).size(), theirs);
  return message;
}

}  // namespace espalier::python

namespace {

nanobind::object& maker() {
  static nanobind::object* the_maker = new nanobind::object();  // NOLINT: the interpreter ends before static objects do
  return *the_maker;
}

void set_error(PyObject* type, const char* text) {
  PyErr_SetString(type, espalier::python::python_words(text).c_str());
}

}  // namespace

NB_MODULE(_core, m) {
  namespace nb = nanobind;
  nb::set_leak_warnings(false);  // objects that live when the interpreter ends are freed by the system
  m.attr("version") = ESPALIER_VERSION;
  m.def("set_error_maker", [](nb::object make) { maker() = std::move(make); });
  nb::register_exception_translator([](const std::exception_ptr& p, void*) {
    try {
      std::rethrow_exception(p);
    } catch (const espalier::Error& e) {
      const espalier::Status& s = e.status();
      const nb::object error =
          maker()(static_cast<int>(s.code), espalier::python::python_words(s.message).c_str(), s.row);
      PyErr_SetObject(reinterpret_cast<PyObject*>(Py_TYPE(error.ptr())), error.ptr());
    } catch (const std::bad_alloc&) {
      set_error(PyExc_MemoryError, "out of memory: use a smaller system or a machine with more memory");
    } catch (const std::length_error&) {
      set_error(PyExc_MemoryError, "out of memory: an array would be larger than any machine's memory");
    } catch (const std::invalid_argument& e) {
      set_error(PyExc_ValueError, e.what());
    } catch (const std::logic_error& e) {
      set_error(PyExc_RuntimeError, e.what());
    }
  });
  espalier::python::bind_solver(m);
  espalier::python::bind_rank_solver(m);
  espalier::python::bind_simulation(m);
  espalier::python::bind_dae(m);
  espalier::python::bind_model_text(m);
  espalier::python::bind_fmu(m);
  espalier::python::bind_modes(m);
  espalier::python::bind_harmonic(m);
  espalier::python::bind_reduced(m);
  espalier::python::bind_changes(m);
  espalier::python::bind_sensitivities(m);
  espalier::python::bind_xla(m);
}

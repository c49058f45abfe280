#include "host.hpp"

#include <nanobind/stl/string.h>
#include <unistd.h>

namespace espalier::python {

thread_local std::exception_ptr Host::raised;

void Host::write(const std::string& line) {
  const nb::gil_scoped_acquire gil;
  if (raised || log.is_none() || !log.is_valid()) return;
  try {
    log(line);
  } catch (...) {
    raised = std::current_exception();
  }
}

// Python runs handlers in its main thread alone.
bool Host::signals_raise() {
  if (gettid() != getpid()) return false;
  const nb::gil_scoped_acquire gil;
  if (raised) return true;
  if (PyErr_CheckSignals() == 0) return false;
  raised = std::make_exception_ptr(nb::python_error());
  return true;
}

bool goes_on(const nb::object& answer) {
  if (answer.is_none()) return true;
  const int truth = PyObject_IsTrue(answer.ptr());
  if (truth < 0) throw nb::python_error();
  return truth != 0;
}

}  // namespace espalier::python

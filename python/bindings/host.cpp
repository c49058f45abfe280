#include "host.hpp"

#include <nanobind/stl/string.h>
#include <unistd.h>

#include <utility>

namespace espalier::python {

thread_local std::exception_ptr Host::raised;

namespace {

// Not an nb::object: a thread may end without the global lock. Who sets it takes it back.
thread_local PyObject* the_tick = nullptr;

}  // namespace

void Host::set_tick(nb::object tick) {
  PyObject* before = std::exchange(the_tick, tick.is_none() ? nullptr : tick.release().ptr());
  Py_XDECREF(before);
}

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
bool Host::interrupted() {
  if (gettid() != getpid()) return false;
  const nb::gil_scoped_acquire gil;
  if (raised) return true;
  try {
    if (the_tick != nullptr) nb::borrow(the_tick)();
    if (PyErr_CheckSignals() != 0) throw nb::python_error();
  } catch (...) {
    raised = std::current_exception();
    return true;
  }
  return false;
}

bool goes_on(const nb::object& answer) {
  if (answer.is_none()) return true;
  const int truth = PyObject_IsTrue(answer.ptr());
  if (truth < 0) throw nb::python_error();
  return truth != 0;
}

}  // namespace espalier::python

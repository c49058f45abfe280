#include "host.hpp"

#include <nanobind/stl/string.h>
#include <unistd.h>

#include <memory>
#include <utility>

#include "espalier/progress.hpp"

namespace espalier::python {

thread_local std::exception_ptr Host::raised;

namespace {

// Not an nb::object: a thread may end without the global lock. Who sets it takes it back.
thread_local PyObject* the_tick = nullptr;
// While there is one, progress() knows something.
thread_local std::unique_ptr<ProgressListener> the_listener;
thread_local ProgressReport last_report;

}  // namespace

void Host::set_tick(nb::object tick) {
  PyObject* before = std::exchange(the_tick, tick.is_none() ? nullptr : tick.release().ptr());
  Py_XDECREF(before);
  the_listener.reset();
  last_report = {};
  if (the_tick != nullptr)
    the_listener = std::make_unique<ProgressListener>([](const ProgressReport& r) { last_report = r; });
}

nb::tuple Host::progress() {
  ProgressReport r = espalier::progress();
  if (r.phase.empty()) r = last_report;
  return nb::make_tuple(r.phase, r.done, r.total, r.unit, r.seconds, r.seconds_left, r.inside, r.inside_done,
                        r.inside_total, r.inside_unit);
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

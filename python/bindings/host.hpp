/// \file
/// What calls that run without the global lock hear from Python, and tell it.
#pragma once

#include <nanobind/nanobind.h>

#include <exception>
#include <string>

namespace espalier::python {

namespace nb = nanobind;

/// Where log lines go. A solver and its clones share it. write() and interrupted() take the global lock.
struct Host {
  nb::object log;  ///< called with a line; None: nobody listens
  /// What Python raised in a call of this thread: lines come from, and signals are seen in, the thread that calls.
  static thread_local std::exception_ptr raised;

  void write(const std::string& line);
  /// Options::interrupted: runs the handlers of signals that have arrived (Ctrl-C raises KeyboardInterrupt), and what
  /// set_tick() has set. Python's main thread alone is asked.
  static bool interrupted();
  /// What calls of this thread do while they are asked whether to stop; None: nothing.
  static void set_tick(nb::object tick);
  /// The fields of espalier::ProgressReport: where the call is, or, after its end, was; while there is a tick.
  static nb::tuple progress();
};

/// What an observer returned: None and what counts as true go on.
bool goes_on(const nb::object& answer);

}  // namespace espalier::python

/// \file
/// What is seen of a run while it lasts: lines of steps, and on a terminal a bar with the time to go.
#pragma once

#include <chrono>
#include <string>

#include "espalier/dynamics.hpp"

namespace espalier::cli {

/// Lines go to stderr. Unless all are wanted, they are thinned out by wall time: at most four a second on a terminal,
/// one a second elsewhere; the first and the last step are always shown.
class StepLog {
 public:
  /// @param enabled false: says nothing @param all a line for every step
  StepLog(bool enabled, bool all, double t_begin, double t_end);
  void add(const SimulationStep& step);
  /// Where a search for an equilibrium stands, when no line was written for some seconds.
  void search(const SimulationSearch& search);
  /// Shows the last step if it was not shown.
  void close();

 private:
  void print(const SimulationStep& step);
  void paint(double t);
  void clear();

  bool enabled_, all_, live_;
  double t_begin_, t_end_;
  std::chrono::steady_clock::time_point start_, last_line_, last_paint_;
  SimulationStep pending_;
  bool waiting_ = false, header_ = false, painted_ = false;
};

}  // namespace espalier::cli

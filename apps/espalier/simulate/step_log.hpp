/// \file
/// What is seen of a simulation while it lasts: lines of steps, above the line of progress.
#pragma once

#include <chrono>

#include "common/progress.hpp"
#include "espalier/dynamics.hpp"

namespace espalier::cli {

/// Lines go to stderr. Unless all are wanted, they are thinned out by wall time: at most four a second on a terminal,
/// one a second elsewhere; the first and the last step are always shown.
class StepLog {
 public:
  /// @param enabled false: says nothing to people @param all a line for every step
  StepLog(bool enabled, bool all, Progress& progress);
  void add(const SimulationStep& step);
  /// Where a search for an equilibrium stands, when no line was written for some seconds.
  void search(const SimulationSearch& search);
  /// Shows the last step if it was not shown.
  void close();

 private:
  void print(const SimulationStep& step);

  bool enabled_, all_;
  Progress& progress_;
  std::chrono::steady_clock::time_point start_, last_line_, last_note_;
  SimulationStep pending_;
  bool waiting_ = false, header_ = false;
};

}  // namespace espalier::cli

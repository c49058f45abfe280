/// \file
/// Ctrl-C, SIGTERM of a queueing system, or SIGHUP of a terminal that is closed asks a command to stop; a second one
/// ends the program at once.
#pragma once

namespace espalier::cli {

/// From the constructor to the destructor such signals are requests.
class StopSignals {
 public:
  StopSignals();
  ~StopSignals();
  StopSignals(const StopSignals&) = delete;
  StopSignals& operator=(const StopSignals&) = delete;
};

/// Whether one has come since the program began.
bool stop_was_asked();

}  // namespace espalier::cli

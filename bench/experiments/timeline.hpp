/// \file
/// One factorization as busy intervals by worker, small enough for a report.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace espalier::bench {

/// Reads a trace that Solver::write_trace() made. The result is {"seconds": T, "tracks": [{"device", "name", "busy":
/// [[begin, end], ...], "waiting": [seconds, ...], "busy_seconds", "waiting_seconds"}]}, seconds from the first event.
/// Neighbouring tasks whose gap is below a thousandth of T become one interval; "waiting" tells of each interval how
/// long its tasks waited for those of others, busy_seconds sums the tasks without these waits.
/// @throws Error(invalid_input) for a file that is no trace
nlohmann::json read_timeline(const std::string& path);

}  // namespace espalier::bench

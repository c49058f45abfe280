/// \file
/// The machine and the state of the source, for the record.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace espalier::bench {

/// Processor (name, family, model), cores this process may use, memory, kernel, load average, GPUs, compiler.
nlohmann::json machine_record();

/// `git describe --always --dirty` of the sources when this was built; "unknown" without git or repository.
std::string source_commit();

/// Date and time in UTC, ISO 8601.
std::string utc_now();

/// Cores this process may use.
int usable_cores();

/// Environment of the rivals' processes: thread counts, and the core type that OpenBLAS must be told. OpenBLAS 0.3.21
/// (Debian 12) takes server processors that are newer than itself for a Prescott and runs DGEMM at a quarter of its
/// speed. A variable that the caller has set stays as it is.
std::vector<std::string> rival_environment(int threads);

}  // namespace espalier::bench

/// \file
/// The machine and the state of the source, for the record.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace espalier::measure {

/// Processor (name, family, model), cores this process may use, memory, kernel, load average, GPUs, compiler.
nlohmann::json machine_record();

/// `git describe --always --dirty` of the sources when this was built; "unknown" without git or repository.
std::string source_commit();

/// Date and time in UTC, ISO 8601.
std::string utc_now();

/// Cores this process may use.
int usable_cores();

}  // namespace espalier::measure

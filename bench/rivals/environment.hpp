/// \file
/// The environment in which rivals run.
#pragma once

#include <string>
#include <vector>

namespace espalier::bench {

/// Environment of the rivals' processes: thread counts, and the core type that OpenBLAS must be told. OpenBLAS 0.3.21
/// (Debian 12) takes server processors that are newer than itself for a Prescott and runs DGEMM at a quarter of its
/// speed. A variable that the caller has set stays as it is.
std::vector<std::string> rival_environment(int threads);

}  // namespace espalier::bench

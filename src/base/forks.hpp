/// \file
/// Whether this process is the child of a fork(): threads, and what else the system keeps for a process, do not follow.
#pragma once

#include <cstdint>

namespace espalier::base {

/// How many times this process, or one that it descends from, came out of a fork() as the child, counted from the first
/// call on: whoever keeps threads or devices compares the number with that of the time when he got them. A ThreadPool
/// starts its workers again at its first call in a child; what another thread of the parent was doing is not gone on
/// with.
std::uint64_t forks();

}  // namespace espalier::base

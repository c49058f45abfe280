/// \file
/// Which of many systems are of one pattern.
#pragma once

#include <span>
#include <vector>

#include "base/thread_pool.hpp"
#include "espalier/batch.hpp"

namespace espalier::batch {

/// Numbers of systems that a Batch can take: of one pattern and storage, with as many right-hand sides, transposed or
/// not, and of one kind whatever their values are. Lists of at least `least`; what is no valid matrix is in none.
/// @param kind  Options::kind
std::vector<std::vector<Index>> equal_patterns(std::span<const System> systems, Kind kind, std::size_t least,
                                               base::ThreadPool& pool);

}  // namespace espalier::batch

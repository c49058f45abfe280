/// \file
/// The host backend: carries out a plan on the threads of a pool.
#pragma once

#include <memory>

#include "base/thread_pool.hpp"
#include "base/timeline.hpp"
#include "device/executor.hpp"

namespace espalier::device::host {

/// @param plan      must outlive the executor
/// @param pool      its threads do the work; must outlive the executor
/// @param budget    counts all memory taken; may be null
/// @param timeline  receives one event per task; may be null
template <class T>
std::unique_ptr<Executor<T>> make_host_executor(const analysis::Plan& plan, Kind kind, const PivotRule& rule,
                                                base::ThreadPool& pool, base::MemoryBudget* budget,
                                                base::Timeline* timeline);

}  // namespace espalier::device::host

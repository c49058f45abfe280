/// \file
/// Streaming on a host device: an arena of the budget's size stands for the device's memory. All that streaming decides
/// runs here, so that it can be tested without a GPU.
#pragma once

#include <functional>
#include <memory>

#include "base/thread_pool.hpp"
#include "device/stream_backend.hpp"

namespace espalier::device::host {

/// What only tests need.
struct HostStreamOptions {
  /// Called before an operation of the run queue; may wait, and may throw, so that the device fails.
  std::function<void(const analysis::StreamOp& op)> before_run;
};

/// @param plan  a copy is kept, whose places change from step to step; one for several devices is carried out by one
/// The workers' scratch and vectors of the matrix' order are not counted as device memory.
template <class T>
std::unique_ptr<StreamBackend<T>> make_host_stream(const analysis::Plan& plan, Kind kind, const PivotRule& rule,
                                                   base::ThreadPool& pool, base::MemoryBudget* budget,
                                                   HostStreamOptions options = {});

}  // namespace espalier::device::host

/// \file
/// Out of core on a host device: an arena of the budget's size stands for the device's memory. All that an out-of-core
/// plan decides runs here, so that it can be tested without a GPU.
#pragma once

#include <functional>
#include <memory>

#include "device/backend.hpp"
#include "out_of_core/backend.hpp"

namespace espalier::device::host {

struct HostOutOfCoreOptions {
  int device = 0;  ///< of `devices`; the first one does the solves, with all threads of the pool
  int devices = 1;
  int threads = 0;  ///< of the device; 0: the pool's
  /// For tests.
  /// Called before an operation of the run queue; may wait, and may throw, so that the device fails.
  std::function<void(const out_of_core::Operation& op)> before_run;
  int refuse_pin = 0;        ///< the request of that number (from 1) to pin memory is refused
  bool late_copies = false;  ///< copies without the ring are made when something waits for them, and not before
};

/// @param job  a copy of its plan is kept, whose places change from step to step; one for several devices is carried
///             out by one
/// The workers' scratch and vectors of the matrix' order are not counted as device memory. Every one of several devices
/// keeps a copy of the plan.
template <class T>
std::unique_ptr<out_of_core::OutOfCoreBackend<T>> make_host_out_of_core_backend(const Job& job,
                                                                                HostOutOfCoreOptions options = {});

}  // namespace espalier::device::host

/// \file
/// The host backend: carries out a plan on the threads of a pool, as one device or as several.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "device/backend.hpp"

namespace espalier::device::host {

/// What only plans for several host devices, and tests, need.
struct HostOptions {
  std::vector<Offset> device_memory_bytes = {};  ///< devices; budget of each, 0: no limit. Empty: none has one
  /// Called before each task by the worker that took it: may wait, so that devices differ in speed, and may throw, so
  /// that one fails. All workers call it at the same time.
  std::function<void(Index device, const plan::Task& task)> before_task;
};

/// A plan for N devices (plan.ownership) is carried out by N teams of pool.size() / N threads, which take tasks and
/// steal sub-trees by the rules of plan::Ownership. The values of the factor do not depend on N, on the number of
/// threads, or on what was stolen: every tile is made by one task, in a fixed order of operations.
///
/// factorize() of several devices throws Error(device_error) naming the device in whose task something was thrown; the
/// others stop, and the executor can be used again.
///
/// @param job  its budget counts all memory taken. Budgets of devices stand in the options
/// @throws Error(out_of_memory) naming the bytes of the device that needs most when its budget is smaller;
///         Error(invalid_input) for fewer threads than devices
template <class T>
std::unique_ptr<Executor<T>> make_host_executor(const Job& job, HostOptions options = {});

/// Most bytes that make_host_executor() takes, with a solution for one right-hand side: arrays of the factor, work
/// arrays of each of `threads` workers, and what is kept by front and by tile. The solution's own part is a bound.
template <class T>
Offset host_bytes(const plan::Plan& plan, Kind kind, int threads);
/// The same with another arena, and another stack of each worker, in elements: out of core.
template <class T>
Offset host_bytes(const plan::Plan& plan, Kind kind, int threads, Offset arena, Offset workers_stack);
/// What make_host_executor() takes on each device, and holds against its budget.
template <class T>
std::vector<Offset> device_bytes(const plan::Plan& plan, Kind kind, int threads);

}  // namespace espalier::device::host

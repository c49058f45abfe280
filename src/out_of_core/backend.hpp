/// \file
/// The seam of a factorization out of core: what a backend does for an executor whose device memory holds only a part
/// of the factorization. Operations of one queue are asked for by one thread and run in order; the queues run side by
/// side. Several devices have a backend each; what one stores, another may wait for.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "base/memory.hpp"
#include "base/thread_pool.hpp"
#include "device/executor.hpp"
#include "out_of_core/front_reader.hpp"
#include "out_of_core/plan.hpp"

namespace espalier::out_of_core {

/// Error(out_of_memory): the device, or the host for the staging ring, has less memory than the plan asks for, although
/// the plan keeps to its budget.
class AllocationRefused : public Error {
 public:
  explicit AllocationRefused(const std::string& what) : Error(StatusCode::out_of_memory, what) {}
};

/// Where the time of an operation is counted.
inline double& time_of(device::OperationTimes& times, OperationType type) {
  switch (type) {
    case OperationType::eliminate:
      return times.steps;
    case OperationType::update:
      return times.updates;
    case OperationType::eliminate_group:
      return times.own_pivots;
    default:
      return times.assembly;
  }
}

template <class T>
class OutOfCoreBackend : public OutOfCoreLayout {
 public:
  virtual void set_pivot_rule(const device::PivotRule& rule) = 0;
  /// Takes the arena and the staging ring, and lays out the tables. The plan must outlive the backend.
  /// @throws AllocationRefused when the device has less
  virtual void prepare(const OutOfCorePlan& plan, int slots, Offset slot_bytes) = 0;
  /// Bytes of the host's memory that prepare() and a solution for one right-hand side take of its budget.
  [[nodiscard]] virtual Offset host_bytes(const OutOfCorePlan& /*plan*/, int /*slots*/, Offset /*slot_bytes*/) const {
    return 0;
  }
  /// Forgets the last factorization. `values` is the caller's array, valid until finish().
  virtual void begin(std::span<const T> values) = 0;
  // Runs that make some units again (PartialRun): backends that PlanningRates::keep_contributions is for.
  /// After a run: the fronts that other values, or the pivot rule that is set, do not leave as they are; not 0: such a
  /// front; of several devices those that this one has made a part of, and the first tells of values. What stands above
  /// them is not marked. Empty: the backend does not tell, and all are to be made.
  /// @param before  the values of that run; compared bit by bit
  [[nodiscard]] virtual std::vector<char> changed_fronts(std::span<const T> /*values*/, std::span<const T> /*before*/) {
    return {};
  }
  /// The next begin() forgets nothing of these fronts. @param kept  fronts, not 0; empty: of none
  virtual void keep(std::span<const char> /*kept*/) {}
  /// Copies to the arena, in the place of an operation of a queue that computes; done when it returns. What is copied
  /// lies within one block that is pinned, or may be.
  virtual void bring(Queue /*queue*/, Offset /*to*/, const std::byte* /*from*/, Offset /*bytes*/) {
    throw std::logic_error("out of core: this backend makes all units");
  }

  /// Called by each thread that uses the backend.
  virtual void enter_thread() = 0;

  /// A slot of the staging ring, memory that the device reaches at full speed.
  virtual std::byte* staging(int slot) = 0;
  /// Copies between the arena and staging memory; when they are done, wait_for_slot() returns.
  virtual void copy_in(Offset to, int slot, Offset bytes) = 0;
  virtual void copy_out(int slot, Offset from, Offset bytes) = 0;
  virtual void wait_for_slot(int slot) = 0;

  /// Makes host memory reachable without the ring, for the backends of all devices. From any thread that has called
  /// enter_thread(), also while a factorization runs. @returns false when the machine refuses; the ring serves on
  virtual bool pin(std::byte* at, Offset bytes) = 0;
  /// @param at  as for pin(); no copy is on its way
  virtual void unpin(std::byte* at) noexcept = 0;
  /// Copies between the arena and memory inside one pinned block; done when the queue's next mark is.
  virtual void copy_in_direct(Offset to, const std::byte* from, Offset bytes) = 0;
  virtual void copy_out_direct(std::byte* to, Offset from, Offset bytes) = 0;

  /// What load_tables copies.
  virtual std::span<const std::byte> tables(const Operation& op) = 0;
  /// Starts an operation of the run queue.
  virtual void run(const Operation& op) = 0;
  /// Gets what store_outputs brought. Empty: the unit is kept, and what it brought last holds; all come in one order.
  virtual void take_outputs(const Operation& op, std::span<const std::byte> bytes) = 0;

  /// Marks the end of operation `number` (from 1) of a queue; what `queue` is asked for later waits for it.
  virtual void mark(Queue queue, std::int64_t number) = 0;
  virtual void wait_for_mark(Queue queue, Queue other, std::int64_t number) = 0;
  /// Waits in the same way for the mark of another device's backend, of the same sort.
  virtual void wait_for_mark(Queue queue, OutOfCoreBackend<T>& of, Queue other, std::int64_t number) = 0;
  /// Blocks the caller instead.
  virtual void wait_until(Queue queue, std::int64_t number) = 0;
  /// Blocks until all is done. @throws Error(device_error)
  virtual void finish() = 0;
  /// After a failure: lets what runs come to an end.
  virtual void abandon() noexcept = 0;
  virtual device::FactorOutcome outcome() = 0;
  /// The times of the last factorization.
  [[nodiscard]] virtual device::OperationTimes times() const = 0;
  /// Several devices: takes over what another backend of the same sort keeps of its pivots for solves.
  virtual void take_pivots(OutOfCoreBackend<T>& from) = 0;

  /// For the solves to come, where a part of the store is on disk: what they read in it they ask of `reader`, which
  /// outlives the backend. The store's address is the same.
  virtual void set_reader(FrontReader* reader) = 0;
  /// Like Executor::solve, from the factors in the host's store and those that stay on the device.
  /// @param reachable  all of the store is pinned: the device may read it itself
  virtual void solve(const T* store, bool reachable, T* x, Index columns, bool transpose) = 0;
  /// Like Executor::solve_on_paths(), likewise: of the store only factors of fronts on the paths are read.
  virtual bool solve_on_paths(const T* /*store*/, bool /*reachable*/, const device::PathSolve<T>& /*solve*/) {
    return false;
  }
  /// Like Executor::invert_at(), likewise.
  virtual bool invert_at(const T* /*store*/, const device::InverseEntries<T>& /*entries*/) { return false; }
  [[nodiscard]] virtual std::string name() const = 0;
  /// Most bytes of device memory that were held at one time, as counted where they were taken.
  [[nodiscard]] virtual Offset peak_bytes() const = 0;
};

}  // namespace espalier::out_of_core

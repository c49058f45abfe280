/// \file
/// Factorization in device memory of any size: carries out out-of-core plans on backends, one for each device, and
/// keeps the factor in the host's memory.
#pragma once

#include <memory>
#include <vector>

#include "base/interruption.hpp"
#include "out_of_core/backend.hpp"
#include "out_of_core/disk_store.hpp"

namespace espalier::out_of_core {

struct OutOfCoreOptions {
  std::vector<OutOfCoreDevice> devices;  ///< one for each backend
  Offset slot_bytes = 8 << 20;           ///< of a buffer of the staging ring
  int slots = 6;                         ///< buffers in each direction, for each device
  int copy_threads = 1;                  ///< in each direction, for each device
  Offset pinned_bytes = 0;               ///< of the host's store that may be page-locked (PinnedStore)
  Offset pinned_block_bytes = 64 << 20;  ///< at a time
  /// Mean bytes of the extents of a copy from which on it goes without the ring: at 55 GB/s such an extent takes two
  /// microseconds, about as long as asking for it.
  Offset least_direct_bytes = 128 << 10;
  /// Where the store goes if it is larger than the window, which a budget with a limit may make smaller.
  DiskOptions disk;
  Offset left_bytes = 0;  ///< of a budget with a limit, that are left to others
  PlanningRates rates;
  base::ThreadPool* pool = nullptr;            ///< its threads plan; null: the calling one
  base::Interruption* interruption = nullptr;  ///< asked between the operations of the first device; null: nobody is
};

/// Substitution runs where the factor is: it does two operations per number, so memory bounds it. The host does what is
/// in its store, but for the part that the link brings to the device in the same time.
/// @param backends  of one plan, and laid out alike; the first one does the solves
/// @throws Error(out_of_memory) naming the least budget that works
template <class T>
std::unique_ptr<device::Executor<T>> make_out_of_core_executor(
    std::vector<std::unique_ptr<OutOfCoreBackend<T>>> backends, const OutOfCoreOptions& options,
    base::MemoryBudget* budget);

/// Bytes of the host's budget that it takes, with a solution for one right-hand side. @throws BudgetTooSmall
template <class T>
Offset host_bytes(const std::vector<std::unique_ptr<OutOfCoreBackend<T>>>& backends, const OutOfCoreOptions& options);

/// What a store on disk would move, by the rules by which it works.
struct DiskPrediction {
  Offset file_bytes = 0;  ///< that the file has at most
  DiskTraffic factorization;
  Offset way_read_bytes = 0;  ///< of one way of a solve
};
/// @param options  disk.window_bytes: what host_bytes() without the store and the window take together
/// @throws BudgetTooSmall, WindowTooSmall
template <class T>
DiskPrediction predict_disk(const std::vector<std::unique_ptr<OutOfCoreBackend<T>>>& backends,
                            const OutOfCoreOptions& options);

/// One device.
template <class T>
std::unique_ptr<device::Executor<T>> make_out_of_core_executor(std::unique_ptr<OutOfCoreBackend<T>> backend,
                                                               const OutOfCoreOptions& options,
                                                               base::MemoryBudget* budget) {
  std::vector<std::unique_ptr<OutOfCoreBackend<T>>> backends;
  backends.push_back(std::move(backend));
  return make_out_of_core_executor<T>(std::move(backends), options, budget);
}

}  // namespace espalier::out_of_core

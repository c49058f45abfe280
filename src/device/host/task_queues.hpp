/// \file
/// Which task comes next on a device: the rules of plan::Ownership, stealing included.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "plan/plan.hpp"

namespace espalier::device::host {

/// Hands out the tasks of a plan to the workers of its devices, each task once. next() may be called by all workers at
/// the same time; while something is open on a device, it costs one atomic addition.
class TaskQueues {
 public:
  explicit TaskQueues(const plan::Plan& plan);
  /// Everything is to be done again.
  void reset();
  /// Number of the next task in plan.tasks for a worker of the device; -1: nothing is left for it.
  Offset next(Index device);
  /// Sub-trees of other devices that this one has taken since reset().
  [[nodiscard]] Index stolen(Index device) const { return queues_[at(device)].stolen; }

 private:
  /// Tasks handed out one after another: a sub-tree, or a device's part of the top. Places in order_.
  struct RunOfTasks {
    Offset begin = 0, end = 0;
    double seconds = 0;
  };
  struct alignas(64) Queue {
    std::atomic<std::uint64_t> cursor{0};  // number of the open unit << 32 | tasks of it handed out
    std::vector<std::uint32_t> units;      // the device's sub-trees in the order of the list
    std::size_t first = 0, last = 0;       // of `units`: those not opened
    double seconds = 0;                    // of those
    std::uint32_t top = 0;
    bool top_begun = false;
    Index stolen = 0;
  };
  static constexpr std::uint32_t kNone = 0xffffffff;

  std::uint32_t open(Queue& queue);

  std::vector<RunOfTasks> units_;
  std::vector<Index> order_;  // numbers of tasks; empty: 0, 1, ...
  std::size_t devices_;
  bool stealing_;
  std::unique_ptr<Queue[]> queues_;
  std::mutex mutex_;  // guards all of Queue but the cursor
};

}  // namespace espalier::device::host

/// \file
/// One device of a factorization out of core: three loops, each on a thread of its own, that ask its backend for what
/// the device computes, what comes to it and what leaves it.
#pragma once

#include <deque>
#include <memory>
#include <span>
#include <vector>

#include "base/stage.hpp"
#include "base/thread_pool.hpp"
#include "out_of_core/backend.hpp"
#include "out_of_core/copies.hpp"
#include "out_of_core/executor.hpp"
#include "out_of_core/partial_run.hpp"
#include "out_of_core/pinned_store.hpp"
#include "out_of_core/progress.hpp"

namespace espalier::out_of_core {

template <class T>
class DeviceRun {
 public:
  DeviceRun(std::unique_ptr<OutOfCoreBackend<T>> backend, Index number, const OutOfCoreOptions& options,
            QueueProgress& progress);

  /// Takes the device's memory; `plan` and `peers`, the backends of all devices, must stay.
  void prepare(const OutOfCorePlan& plan, const std::vector<OutOfCoreBackend<T>*>& peers);
  /// @param pinned  of the store
  /// @param disk  the store, where a part of it is on disk; else null
  /// @param part  outlives the run
  void begin(std::span<const T> values, T* store, const PinnedStore& pinned, DiskStore* disk, const PartialRun& part);
  /// @param stage  that of the factorization, in which each operation is a part of `share`; may be null
  void run_all(base::Stage* stage, double share);
  void load_all();
  void store_all();

  /// Queues of a device that use a store on disk: copies both ways, and what is brought for a run that makes a part.
  static constexpr int kDiskQueues = 3;

  [[nodiscard]] OutOfCoreBackend<T>& backend() { return *backend_; }
  [[nodiscard]] const OutOfCoreBackend<T>& backend() const { return *backend_; }
  /// Threads that copy to the host.
  base::ThreadPool& crew() { return out_crew_; }
  [[nodiscard]] device::OutOfCoreReport report(Offset budget_bytes) const;

 private:
  struct Arrival {  // a slot on its way to the host, or a whole operation that needs none
    int slot;
    const Operation* op;
    std::int64_t number;
    Offset begin, size;
    bool last;
  };

  template <class Meanwhile>
  void wait_for_runs(const Operation& op, Meanwhile&& meanwhile);
  template <class Meanwhile>
  void wait_for_others(const Operation& op, Meanwhile&& meanwhile);
  void tell_disk(Queue queue, const Operation* op);
  void bring(const Operation& op);
  void load(const Operation& op, int& slot);
  void load_values(const Operation& op, int& slot);
  void load_directly(Offset to);
  template <class Fill>
  void load_through_ring(Offset to, Offset bytes, int& slot, Fill&& fill);
  void extents_of(const Operation& op, int part, HostExtents& extents);
  void arrivals_of(const Operation& op, HostExtents& extents);
  [[nodiscard]] bool goes_directly(const HostExtents& extents) const;
  template <class Copy>
  void by_pinned_block(const HostExtents& extents, Copy&& copy) const;
  void send(const Operation& op, std::int64_t number, int& slot);
  void send_directly(const Operation& op, std::int64_t number);
  void send_through_ring(const Operation& op, std::int64_t number, int& slot);
  void empty(const Arrival& a);
  bool receive();

  std::unique_ptr<OutOfCoreBackend<T>> backend_;
  Index number_;
  const OutOfCoreOptions& options_;
  QueueProgress& progress_;
  const OutOfCorePlan* plan_ = nullptr;
  base::ThreadPool in_crew_, out_crew_;
  std::vector<const Operation*> loads_, runs_, stores_;
  std::span<const T> values_;
  T* store_ = nullptr;
  const PinnedStore* pinned_ = nullptr;
  DiskStore* disk_ = nullptr;
  const PartialRun* part_ = nullptr;
  const std::vector<OutOfCoreBackend<T>*>* peers_ = nullptr;
  EntryRanges gathered_;             // of the copies to the device
  HostExtents extents_;              // likewise
  std::deque<Arrival> on_the_way_;   // of the copies to the host
  int slots_on_the_way_ = 0;         // likewise
  HostExtents arrivals_, received_;  // likewise
  std::vector<std::byte> outputs_;   // likewise
  double in_seconds_ = 0, out_seconds_ = 0;
  Offset in_direct_ = 0, out_direct_ = 0;
};

}  // namespace espalier::out_of_core

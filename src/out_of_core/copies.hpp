/// \file
/// The host's side of a factorization out of core: what an operation copies, extent by extent, between the host's store
/// and the staging ring.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "base/thread_pool.hpp"
#include "out_of_core/disk_store.hpp"
#include "out_of_core/plan.hpp"

namespace espalier::out_of_core {

/// Extents of host memory that lie one after another on the device.
class HostExtents {
 public:
  void clear();
  void add(std::byte* at, Offset bytes);
  [[nodiscard]] Offset bytes() const { return end_.empty() ? 0 : end_.back(); }
  [[nodiscard]] std::size_t count() const { return at_.size(); }
  /// use(address, bytes before it, bytes) for each extent; stops when it returns false. @returns whether all were used
  template <class Use>
  bool each(Use&& use) const {
    for (std::size_t k = 0; k < at_.size(); ++k) {
      const Offset before = k == 0 ? 0 : end_[k - 1];
      if (!use(at_[k], before, end_[k] - before)) return false;
    }
    return true;
  }
  /// Copies bytes [begin, begin + size) of the extents to `to`, or from `from`, by all threads of the pool.
  /// @param disk  in which the extents are; null: they are in memory
  void copy_to(std::byte* to, Offset begin, Offset size, base::ThreadPool& pool, DiskStore* disk) const;
  void copy_from(const std::byte* from, Offset begin, Offset size, base::ThreadPool& pool, DiskStore* disk) const;

 private:
  template <class Use>
  void visit(Offset begin, Offset size, base::ThreadPool& pool, Use&& use) const;
  std::vector<std::byte*> at_;
  std::vector<Offset> end_;  // sum of bytes up to and with the extent
};

/// Places of the values of A that a step or group needs, in the order of its entries.
class EntryRanges {
 public:
  /// Takes the ranges of the load_values operation `op`.
  void set(const OutOfCoreLayout& layout, const OutOfCorePlan& units, const Operation& op);
  [[nodiscard]] Offset size() const { return end_.empty() ? 0 : end_.back(); }
  /// Values [begin, begin + size) to `to`.
  template <class T>
  void gather(std::span<const T> values, T* to, Offset begin, Offset size, base::ThreadPool& pool) const;

 private:
  const plan::Plan* plan_ = nullptr;
  std::vector<Offset> first_;  // entries of the plan
  std::vector<Offset> end_;
};

}  // namespace espalier::out_of_core

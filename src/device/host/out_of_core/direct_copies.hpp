/// \file
/// What stands for page-locked memory and for copies without a staging ring on a machine without a GPU.
#pragma once

#include <array>
#include <cstddef>
#include <map>
#include <mutex>
#include <vector>

#include "out_of_core/plan.hpp"

namespace espalier::device::host {

/// Ranges of host memory that count as page-locked.
class PinnedMemory {
 public:
  /// @returns false when a part of the range is pinned
  bool add(std::byte* at, Offset bytes);
  void remove(std::byte* at) noexcept;
  /// @throws std::logic_error unless one pinned range holds all of [at, at + bytes)
  void check(const std::byte* at, Offset bytes) const;
  /// @throws std::logic_error if a part of it is pinned, and one range does not hold all: drivers refuse such copies
  void check_not_torn(const std::byte* at, Offset bytes) const;

 private:
  mutable std::mutex mutex_;
  std::map<const std::byte*, Offset> ranges_;
};

/// The process's.
PinnedMemory& pinned_memory();

/// Copies of a device's queues. Late ones are made when something waits for their mark, as late as a GPU may make them:
/// what uses their data without waiting gets the old one.
class DirectCopies {
 public:
  explicit DirectCopies(bool late) : late_(late) {}
  /// Forgets all.
  void begin();
  void copy(out_of_core::Queue queue, std::byte* to, const std::byte* from, Offset bytes);
  /// What was asked for since the last mark belongs to operation `number`.
  void mark(out_of_core::Queue queue, std::int64_t number);
  /// The first `number` operations of the queue are done afterwards.
  void wait(out_of_core::Queue queue, std::int64_t number);

 private:
  struct Copy {
    std::int64_t number;  // 0: not marked yet
    std::byte* to;
    const std::byte* from;
    Offset bytes;
  };
  const bool late_;
  std::mutex mutex_;
  std::array<std::vector<Copy>, out_of_core::kQueues> queues_;
};

}  // namespace espalier::device::host

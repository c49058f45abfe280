/// \file
/// What is finished: flags that tasks set and wait for.
#pragma once

#include <atomic>
#include <memory>
#include <thread>

#include "base/timeline.hpp"
#include "espalier/types.hpp"

namespace espalier::device::host {

/// Thrown out of a wait when another worker has failed; the failure itself is reported by that worker.
struct Aborted {};

/// Flags of one numbered set of events. A wait ends as soon as the event is set, or with Aborted once abort() was
/// called. Events are waited for only by tasks that stand later in the task list than the task that sets them, so a
/// wait cannot deadlock.
class Progress {
 public:
  explicit Progress(Offset events)
      : size_(events), flags_(std::make_unique<std::atomic<std::uint8_t>[]>(static_cast<std::size_t>(events))) {}

  void reset() {
    for (Offset e = 0; e < size_; ++e) flags_[e].store(0, std::memory_order_relaxed);
  }
  /// @param value  not 0
  void set(Offset event, std::uint8_t value = 1) { flags_[event].store(value, std::memory_order_release); }
  [[nodiscard]] std::uint8_t value(Offset event) const { return flags_[event].load(std::memory_order_acquire); }
  [[nodiscard]] bool is_set(Offset event) const { return flags_[event].load(std::memory_order_acquire) != 0; }

  /// @param abort   checked while waiting
  /// @param waited  the seconds waited are added there; may be null
  void wait(Offset event, const std::atomic<bool>& abort, double* waited = nullptr) const {
    if (is_set(event)) return;
    const double begin = waited != nullptr ? base::now_seconds() : 0;
    spin(event, abort);
    if (waited != nullptr) *waited += base::now_seconds() - begin;
  }

 private:
  void spin(Offset event, const std::atomic<bool>& abort) const {
    constexpr int kSpinsBeforeYield = 10000;  // some 0.3 ms: longer than most tasks, shorter than a time slice
    for (int spins = 0; !is_set(event); ++spins) {
      if (abort.load(std::memory_order_relaxed)) throw Aborted{};
      if (spins > kSpinsBeforeYield) {
        std::this_thread::yield();
      } else {
#if defined(__x86_64__)
        __builtin_ia32_pause();
#endif
      }
    }
  }

  Offset size_;
  std::unique_ptr<std::atomic<std::uint8_t>[]> flags_;
};

}  // namespace espalier::device::host

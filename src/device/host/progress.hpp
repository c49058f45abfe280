/// \file
/// What is finished: flags that tasks set and wait for.
#pragma once

#include <atomic>
#include <chrono>
#include <memory>
#include <thread>

#include "base/timeline.hpp"
#include "espalier/types.hpp"

namespace espalier::device::host {

/// Thrown out of a wait when another worker has failed; the failure itself is reported by that worker.
struct Aborted {};

/// What a thread does while it waits: of ranks, the one that calls drives their messages.
class WhileWaiting {
 public:
  virtual ~WhileWaiting() = default;
  /// Between two pieces of work.
  virtual void poll() = 0;
  /// A wait begins; it is looked whether it has lasted too long.
  virtual void begin_waiting() = 0;
  virtual void expect_patience() = 0;

  /// What this thread does; null: nothing.
  static constinit inline thread_local WhileWaiting* here = nullptr;
};

/// Flags of one numbered set of events. A wait ends as soon as the event is set, or with Aborted once abort() was
/// called. Events are waited for only by tasks that stand later in the task list than the task that sets them, so a
/// wait cannot deadlock.
class Progress {
 public:
  explicit Progress(Offset events) : size_(events), flags_(std::make_unique<std::atomic<std::uint8_t>[]>(at(events))) {}

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
    if (WhileWaiting::here != nullptr) WhileWaiting::here->poll();
    if (is_set(event)) return;
    const double begin = waited != nullptr ? base::now_seconds() : 0;
    spin(event, abort);
    if (waited != nullptr) *waited += base::now_seconds() - begin;
  }

 private:
  void spin(Offset event, const std::atomic<bool>& abort) const {
    if (WhileWaiting::here != nullptr) return drive(event, abort, *WhileWaiting::here);
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

  void drive(Offset event, const std::atomic<bool>& abort, WhileWaiting& meanwhile) const {
    constexpr int kLooksBeforeYield = 100, kLooksBeforeSleep = 5000, kLooksOfPatience = 256;
    meanwhile.begin_waiting();
    for (int looks = 1; !is_set(event); ++looks) {
      if (abort.load(std::memory_order_relaxed)) throw Aborted{};
      meanwhile.poll();
      if (looks % kLooksOfPatience == 0) meanwhile.expect_patience();
      if (looks > kLooksBeforeSleep)
        std::this_thread::sleep_for(std::chrono::microseconds(20));
      else if (looks > kLooksBeforeYield)
        std::this_thread::yield();
    }
  }

  Offset size_;
  std::unique_ptr<std::atomic<std::uint8_t>[]> flags_;
};

}  // namespace espalier::device::host

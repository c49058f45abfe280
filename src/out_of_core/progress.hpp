/// \file
/// How far the queues of all devices are.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <vector>

#include "out_of_core/plan.hpp"

namespace espalier::out_of_core {

/// Thrown out of a wait when another thread has failed.
struct Stopped {};

/// Operations of every queue that were asked for, and, for copies, those whose host side is done.
class QueueProgress {
 public:
  explicit QueueProgress(Index devices) : asked_(static_cast<std::size_t>(devices) * kQueues, 0), done_(asked_) {}

  void reset() {
    std::fill(asked_.begin(), asked_.end(), 0);
    std::fill(done_.begin(), done_.end(), 0);
    stopped_ = false;
  }
  void asked(Index device, Queue q, std::int64_t number) { set(asked_[at(device, q)], number); }
  void done(Index device, Queue q, std::int64_t number) { set(done_[at(device, q)], number); }

  /// Waits; as long as there is something to wait for and meanwhile() returns true, it is called again.
  /// @throws Stopped after stop()
  template <class Meanwhile>
  void wait_asked(Index device, Queue q, std::int64_t number, Meanwhile&& meanwhile) {
    wait(asked_[at(device, q)], number, meanwhile);
  }
  template <class Meanwhile>
  void wait_done(Index device, Queue q, std::int64_t number, Meanwhile&& meanwhile) {
    wait(done_[at(device, q)], number, meanwhile);
  }
  void wait_asked(Index device, Queue q, std::int64_t number) {
    wait_asked(device, q, number, [] { return false; });
  }
  void wait_done(Index device, Queue q, std::int64_t number) {
    wait_done(device, q, number, [] { return false; });
  }

  void stop() {
    const std::lock_guard lock(mutex_);
    stopped_ = true;
    changed_.notify_all();
  }

 private:
  [[nodiscard]] static std::size_t at(Index device, Queue q) {
    return static_cast<std::size_t>(device) * kQueues + static_cast<std::size_t>(q);
  }
  void set(std::int64_t& of, std::int64_t number) {
    const std::lock_guard lock(mutex_);
    of = number;
    changed_.notify_all();
  }
  template <class Meanwhile>
  void wait(const std::int64_t& of, std::int64_t number, Meanwhile& meanwhile) {
    std::unique_lock lock(mutex_);
    const auto ready = [&] { return stopped_ || of >= number; };
    while (!ready()) {
      lock.unlock();
      const bool more = meanwhile();
      lock.lock();
      if (!more) changed_.wait(lock, ready);
    }
    if (stopped_) throw Stopped{};
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<std::int64_t> asked_, done_;
  bool stopped_ = false;
};

}  // namespace espalier::out_of_core

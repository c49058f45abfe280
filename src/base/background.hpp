/// \file
/// Work that goes on beside what the caller does next: files that are written while the next steps are made.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>

namespace espalier::base {

/// Does tasks in their order on a thread of its own, which the first task starts; where the system refuses a thread,
/// the caller does them. After a task that failed nothing more is done until its exception was thrown to the caller.
class Background {
 public:
  /// @param most  so many tasks may wait, with the memory that they hold; enqueue() waits for a place
  explicit Background(std::size_t most = 2) : most_(most) {}
  /// Waits for what was enqueued; a failure that nobody has heard of is lost.
  ~Background();
  Background(const Background&) = delete;
  Background& operator=(const Background&) = delete;
  /// @throws what an earlier task has thrown; `task` is not taken then
  void enqueue(std::function<void()> task);
  /// Until nothing is left to do. @throws what a task has thrown
  void wait();

 private:
  void work();
  [[nodiscard]] bool start();
  void throw_failure(std::unique_lock<std::mutex>& lock);

  const std::size_t most_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::function<void()>> waiting_;
  bool busy_ = false, ends_ = false;
  std::exception_ptr failure_;
  std::thread thread_;
};

}  // namespace espalier::base

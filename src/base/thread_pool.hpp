/// \file
/// A fixed team of threads: parallel regions, parallel loops, and fork-join task groups for recursions.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

#include "base/interruption.hpp"

namespace espalier::base {

/// Cores that this process may use (its affinity mask), at least 1.
int available_cores();

/// `size()` workers, fewer than asked for where the system refuses threads: the caller is worker 0, the others sleep
/// between calls (after a short spin, for calls that follow closely). One parallel call at a time. See also forks.hpp.
class ThreadPool {
 public:
  /// @param interruption  asked between ranges and tasks, which then end with what it throws; null: nobody is
  explicit ThreadPool(int threads, Interruption* interruption = nullptr);
  ~ThreadPool();
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  /// Between pieces of work, in any worker. @throws Error(cancelled), see Interruption
  void check() {
    if (interruption_ != nullptr) interruption_->check();
  }
  [[nodiscard]] Interruption* interruption() const { return interruption_; }

  [[nodiscard]] int size() const { return static_cast<int>(threads_.size()) + 1; }

  /// Runs body(worker) once on every worker at the same time and returns when all have returned. The first exception
  /// (by worker number) is rethrown. Must not be nested.
  /// A callable that is not a std::function yet is referred to, so that the call allocates nothing.
  void run(const std::function<void(int worker)>& body);
  template <class Body>
  void run(Body&& body) {
    const std::function<void(int)> reference(std::ref(body));
    run(reference);
  }

  /// body(0) by the caller, and body(worker) by each other worker that is awake before the caller's has returned; who
  /// comes too late is not waited for. For bodies that take pieces of work until none is left.
  void share(const std::function<void(int worker)>& body);
  template <class Body>
  void share(Body&& body) {
    const std::function<void(int)> reference(std::ref(body));
    share(reference);
  }

  /// body(begin, end) over ranges of [0, n) of at most `grain` indices, taken by whoever is free. The ranges are the
  /// same for every number of threads.
  void for_each_range(std::int64_t n, std::int64_t grain,
                      const std::function<void(std::int64_t begin, std::int64_t end)>& body);
  template <class Body>
  void for_each_range(std::int64_t n, std::int64_t grain, Body&& body) {
    const std::function<void(std::int64_t, std::int64_t)> reference(std::ref(body));
    for_each_range(n, grain, reference);
  }

  /// body(i) for each i in [0, n), taken one by one in rising order.
  void for_each(std::int64_t n, const std::function<void(std::int64_t i)>& body) {
    for_each_range(n, 1, [&](std::int64_t begin, std::int64_t) { body(begin); });
  }

 private:
  enum class Mode { all, who_comes };
  void call(const std::function<void(int)>& body, Mode mode);
  bool enter(std::uint64_t generation);
  void start_again();
  void work(int worker);
  void stop_and_join();

  Interruption* interruption_;
  std::vector<std::thread> threads_;
  std::mutex mutex_;
  std::condition_variable wake_;
  std::condition_variable done_;
  const std::function<void(int)>* body_ = nullptr;
  std::vector<std::exception_ptr> errors_;
  std::atomic<std::uint64_t> generation_{0};
  std::atomic<std::uint64_t> running_{0};  // how many are in the call, whether others may join, and which call it is
  std::atomic<bool> stop_{false};
};

/// Runs a recursion in parallel: `root(recursion)` may spawn() further tasks from any worker; recurse() returns when
/// all tasks have ended. The order in which tasks run is not defined; results must not depend on it.
class Recursion {
 public:
  using Task = std::function<void(Recursion&)>;
  /// Runs `root` and everything that it spawns on the pool. Rethrows the first exception.
  static void run(ThreadPool& pool, Task root);
  /// Adds a task; any worker may take it.
  void spawn(Task task);

  /// Called in a task: body(begin, end) over the ranges of [0, n) as in ThreadPool::for_each_range, by the caller and
  /// by all workers that have no task. Returns when all ranges are done; rethrows what body throws.
  template <class Body>
  void for_each_range(std::int64_t n, std::int64_t grain, Body&& body) {
    const std::function<void(std::int64_t, std::int64_t)> reference(std::ref(body));
    run_loop(n, grain, reference);
  }

 private:
  using RangeBody = std::function<void(std::int64_t, std::int64_t)>;
  struct Loop {
    const RangeBody& body;
    std::int64_t n, grain;
    std::atomic<std::int64_t> next{0};
    std::atomic<int> helpers{0};
    std::exception_ptr error;  // guarded by mutex_
  };

  bool take_and_run();
  void run_loop(std::int64_t n, std::int64_t grain, const RangeBody& body);
  void run_ranges(Loop& loop);
  void withdraw(const Loop& loop);
  void wait_for_work(std::unique_lock<std::mutex>& lock);
  void check() {
    if (interruption_ != nullptr) interruption_->check();
  }

  explicit Recursion(Interruption* interruption) : interruption_(interruption) {}

  Interruption* interruption_;
  void announce(bool to_all);

  std::mutex mutex_;
  std::condition_variable available_;
  std::condition_variable left_;  // the last helper has left a loop
  std::deque<Task> tasks_;
  std::vector<Loop*> loops_;            // loops that have ranges left
  std::atomic<std::uint64_t> news_{0};  // counts what an idle worker should look at
  int sleepers_ = 0;
  int open_ = 0;  // tasks waiting or running
  std::exception_ptr error_;
};

}  // namespace espalier::base

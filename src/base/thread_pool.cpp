#include "base/thread_pool.hpp"

#include <fmt/format.h>
#include <sched.h>

#include <algorithm>
#include <chrono>
#include <new>
#include <system_error>
#include <utility>

#include "base/forks.hpp"
#include "espalier/types.hpp"

namespace espalier::base {

namespace {
// Spins before sleeping so long: some futex wake-ups. It is measured by the clock, because a pause takes 24 ns on one
// processor and 50 on another.
constexpr std::chrono::microseconds kSpin{50};

void relax() {
#if defined(__x86_64__)
  __builtin_ia32_pause();
#else
  std::this_thread::yield();
#endif
}

// Returns as soon as done(), and after kSpin anyway.
template <class Done>
void spin_until(const Done& done) {
  constexpr int kPauses = 32;  // about a microsecond between looks at the clock
  const auto end = std::chrono::steady_clock::now() + kSpin;
  do {
    for (int s = 0; s < kPauses; ++s) {
      if (done()) return;
      relax();
    }
  } while (std::chrono::steady_clock::now() < end);
}

// ThreadPool::generation_ counts the calls in its lower bits; the upper ones say in which process.
constexpr int kCallBits = 48;
std::uint64_t first_generation() { return forks() << kCallBits; }
bool same_process(std::uint64_t generation) { return generation >> kCallBits == first_generation() >> kCallBits; }

// ThreadPool::running_: the call in the upper bits, then whether others may join it, then how many are in it.
constexpr int kCountBits = 15;
constexpr std::uint64_t kJoin = std::uint64_t{1} << kCountBits;
constexpr std::uint64_t kCalls = ~std::uint64_t{0} << (kCountBits + 1);
std::uint64_t in_call(std::uint64_t generation, bool join, std::uint64_t count) {
  return (generation << (kCountBits + 1)) | (join ? kJoin : 0) | count;
}
std::uint64_t count(std::uint64_t running) { return running & (kJoin - 1); }
bool may_join(std::uint64_t running) { return (running & kJoin) != 0; }
bool same_call(std::uint64_t running, std::uint64_t generation) {
  return (running & kCalls) == generation << (kCountBits + 1);
}

// In the child of a fork(), where the threads are no more: their locks may be held for ever, and a condition variable
// with a sleeper waits for him when it is destroyed. New ones take their places; the old ones own nothing.
void abandon(std::vector<std::thread>& threads, std::mutex& mutex, std::condition_variable& wake,
             std::condition_variable& done) {
  for (auto& t : threads) ::new (&t) std::thread();
  ::new (&mutex) std::mutex();
  ::new (&wake) std::condition_variable();
  ::new (&done) std::condition_variable();
}

template <class Done>
void wait(Interruption* interruption, std::condition_variable& changed, std::unique_lock<std::mutex>& lock, Done done) {
  if (interruption != nullptr) return interruption->wait(changed, lock, done);
  changed.wait(lock, done);
}

}  // namespace

int available_cores() {
  cpu_set_t set;
  CPU_ZERO(&set);
  if (sched_getaffinity(0, sizeof set, &set) == 0) return std::max(1, CPU_COUNT(&set));
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

// What the system refuses to one more thread - memory for its stack, a place among its processes - the work of the
// others will lack, too. With nothing left each of hundreds of threads throws at the same time, and C++ ends a process
// that has no memory for its exceptions. So half of them are given back.
ThreadPool::ThreadPool(int threads, Interruption* interruption) : interruption_(interruption) {
  int extra = std::max(1, threads) - 1;
  errors_.resize(static_cast<std::size_t>(extra) + 1);
  threads_.reserve(static_cast<std::size_t>(extra));
  while (extra > 0) {
    generation_ = first_generation();
    try {
      for (int t = 0; t < extra; ++t) threads_.emplace_back([this, t] { work(t + 1); });
      return;
    } catch (const std::system_error&) {
      extra = static_cast<int>(threads_.size()) / 2;
      stop_and_join();
      threads_.clear();
      stop_ = false;
    } catch (...) {  // no memory: those that run must end before the exception may leave
      stop_and_join();
      throw;
    }
  }
  generation_ = first_generation();
}

ThreadPool::~ThreadPool() { stop_and_join(); }

void ThreadPool::stop_and_join() {
  if (!same_process(generation_)) return abandon(threads_, mutex_, wake_, done_);
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
    generation_.fetch_add(1, std::memory_order_release);
  }
  wake_.notify_all();
  for (auto& t : threads_)
    if (t.joinable()) t.join();
}

void ThreadPool::work(int worker) {
  std::uint64_t seen = first_generation();  // no call comes before all workers have been made
  for (;;) {
    spin_until([&] { return generation_.load(std::memory_order_acquire) != seen; });
    if (generation_.load(std::memory_order_acquire) == seen) {
      std::unique_lock lock(mutex_);
      wake_.wait(lock, [&] { return generation_.load(std::memory_order_acquire) != seen; });
    }
    seen = generation_.load(std::memory_order_acquire);
    if (stop_) return;
    if (!enter(seen)) continue;
    try {
      (*body_)(worker);
    } catch (...) {
      errors_[static_cast<std::size_t>(worker)] = std::current_exception();
    }
    if (count(running_.fetch_sub(1, std::memory_order_acq_rel)) == 1) {
      const std::lock_guard lock(mutex_);
      done_.notify_one();
    }
  }
}

// Into the call of this generation: where all are waited for, the worker is counted already, else unless it is over.
bool ThreadPool::enter(std::uint64_t generation) {
  std::uint64_t now = running_.load(std::memory_order_acquire);
  while (same_call(now, generation) && count(now) > 0) {
    if (!may_join(now)) return true;
    if (running_.compare_exchange_weak(now, now + 1, std::memory_order_acq_rel)) return true;
  }
  return false;
}

// After a fork(): the parent's team stays where it lies.
void ThreadPool::start_again() {
  const auto before = threads_.size();
  const std::uint64_t parents = generation_;
  ::new (this) ThreadPool(size(), interruption_);
  if (threads_.size() >= before) return;
  stop_and_join();  // callers have counted the workers: all or none
  threads_.resize(before);
  generation_ = parents;
  throw Error(StatusCode::out_of_memory,
              fmt::format("after a fork() {} threads are to be started again, and the system refuses; ask for fewer "
                          "threads, or raise the limit (ulimit -u)",
                          before));
}

void ThreadPool::run(const std::function<void(int)>& body) { call(body, Mode::all); }
void ThreadPool::share(const std::function<void(int)>& body) { call(body, Mode::who_comes); }

void ThreadPool::call(const std::function<void(int)>& body, Mode mode) {
  if (!same_process(generation_)) start_again();
  if (threads_.empty()) return body(0);
  std::fill(errors_.begin(), errors_.end(), nullptr);
  body_ = &body;
  const std::uint64_t generation = generation_.load(std::memory_order_relaxed) + 1;
  // The caller counts as one of those in the call.
  running_.store(in_call(generation, mode == Mode::who_comes, mode == Mode::all ? threads_.size() + 1 : 1),
                 std::memory_order_release);
  {
    const std::lock_guard lock(mutex_);
    generation_.store(generation, std::memory_order_release);
  }
  wake_.notify_all();
  try {
    body(0);
  } catch (...) {
    errors_[0] = std::current_exception();
  }
  if (count(running_.fetch_sub(1, std::memory_order_acq_rel)) > 1) {
    const auto all_left = [&] { return count(running_.load(std::memory_order_acquire)) == 0; };
    spin_until(all_left);
    std::unique_lock lock(mutex_);
    wait(interruption_, done_, lock, all_left);
  }
  for (auto& e : errors_)
    if (e) std::rethrow_exception(e);
}

void ThreadPool::for_each_range(std::int64_t n, std::int64_t grain,
                                const std::function<void(std::int64_t, std::int64_t)>& body) {
  grain = std::max<std::int64_t>(1, grain);
  if (threads_.empty() || n <= grain) {
    for (std::int64_t b = 0; b < n; b += grain) {
      check();
      body(b, std::min(n, b + grain));
    }
    return;
  }
  std::atomic<std::int64_t> next{0};
  share([&](int) {
    for (;;) {
      const std::int64_t b = next.fetch_add(grain, std::memory_order_relaxed);
      if (b >= n) return;
      check();
      body(b, std::min(n, b + grain));
    }
  });
}

void Recursion::announce(bool to_all) {
  news_.fetch_add(1, std::memory_order_release);
  if (sleepers_ == 0) return;
  to_all ? available_.notify_all() : available_.notify_one();
}

void Recursion::spawn(Task task) {
  const std::lock_guard lock(mutex_);
  tasks_.push_back(std::move(task));
  ++open_;
  announce(false);
}

/// Waits until there is a task or a loop, or nothing will come any more; first without sleeping, since loops follow
/// each other closely.
void Recursion::wait_for_work(std::unique_lock<std::mutex>& lock) {
  const auto something = [&] { return !tasks_.empty() || !loops_.empty() || open_ == 0; };
  if (something()) return;
  const std::uint64_t seen = news_.load(std::memory_order_relaxed);
  lock.unlock();
  spin_until([&] { return news_.load(std::memory_order_acquire) != seen; });
  lock.lock();
  ++sleepers_;
  wait(interruption_, available_, lock, something);
  --sleepers_;
}

bool Recursion::take_and_run() {
  Task task;
  {
    std::unique_lock lock(mutex_);
    wait_for_work(lock);
    if (!loops_.empty()) {  // first: a task waits for its loop
      Loop& loop = *loops_.back();
      loop.helpers.fetch_add(1, std::memory_order_relaxed);
      lock.unlock();
      run_ranges(loop);
      lock.lock();
      withdraw(loop);
      if (loop.helpers.fetch_sub(1, std::memory_order_release) == 1) left_.notify_all();
      return true;
    }
    if (tasks_.empty()) return false;
    task = std::move(tasks_.back());
    tasks_.pop_back();
    if (error_) {  // a task failed: the rest is dropped
      if (--open_ == 0) announce(true);
      return true;
    }
  }
  try {
    check();
    task(*this);
  } catch (...) {
    const std::lock_guard lock(mutex_);
    if (!error_) error_ = std::current_exception();
  }
  const std::lock_guard lock(mutex_);
  if (--open_ == 0) announce(true);
  return true;
}

void Recursion::run_ranges(Loop& loop) {
  try {
    for (;;) {
      const std::int64_t b = loop.next.fetch_add(loop.grain, std::memory_order_relaxed);
      if (b >= loop.n) return;
      check();
      loop.body(b, std::min(loop.n, b + loop.grain));
    }
  } catch (...) {
    loop.next.store(loop.n, std::memory_order_relaxed);
    const std::lock_guard lock(mutex_);
    if (!loop.error) loop.error = std::current_exception();
  }
}

/// Nobody else shall join the loop. @pre mutex_ is held
void Recursion::withdraw(const Loop& loop) {
  const auto at = std::find(loops_.begin(), loops_.end(), &loop);
  if (at != loops_.end()) loops_.erase(at);
}

void Recursion::run_loop(std::int64_t n, std::int64_t grain, const RangeBody& body) {
  grain = std::max<std::int64_t>(1, grain);
  if (n <= grain) {
    if (n > 0) body(0, n);
    return;
  }
  Loop loop{body, n, grain, {}, {}, nullptr};
  {
    const std::lock_guard lock(mutex_);
    loops_.push_back(&loop);
    announce(true);
  }
  run_ranges(loop);
  std::unique_lock lock(mutex_);
  withdraw(loop);
  lock.unlock();
  spin_until([&] { return loop.helpers.load(std::memory_order_acquire) == 0; });
  lock.lock();  // also where nobody helps any more: the last helper must have let go of the mutex
  wait(interruption_, left_, lock, [&] { return loop.helpers.load(std::memory_order_acquire) == 0; });
  if (loop.error) std::rethrow_exception(loop.error);
}

void Recursion::run(ThreadPool& pool, Task root) {
  Recursion recursion(pool.interruption());
  recursion.spawn(std::move(root));
  pool.share([&](int) {
    while (recursion.take_and_run()) {
    }
  });
  if (recursion.error_) std::rethrow_exception(recursion.error_);
}

}  // namespace espalier::base

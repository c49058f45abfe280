/// \file
/// How a caller stops a call that takes long: the call asks him, now and then, whether to go on.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>
#include <utility>

namespace espalier::base {

/// Calls of one object, one at a time. Only the thread that calls asks; the others hear of the answer at the borders of
/// their work.
class Interruption {
 public:
  using Clock = std::chrono::steady_clock;

  /// @param ask  whether to stop; must not throw (what it throws counts as yes). Empty: nobody is asked
  /// @param period  between two questions
  Interruption(std::function<bool()> ask, Clock::duration period) : ask_(std::move(ask)), period_(period) {}

  /// A call by this thread, from the constructor to the destructor. Calls may be nested: the outer one counts.
  class Call {
   public:
    explicit Call(Interruption& interruption);
    ~Call();
    Call(const Call&) = delete;
    Call& operator=(const Call&) = delete;

   private:
    Interruption* interruption_;  // null: inside another call, or nobody is asked
  };

  /// Between pieces of work, in any thread. Costs a branch where nobody is asked, else some 20 ns.
  /// @throws Error(cancelled) once the caller has said stop
  void check() {
    if (ask_) throw_if_stopped();
  }
  /// Waits like changed.wait(lock, done) and asks meanwhile, in the thread that calls; does not throw.
  template <class Done>
  void wait(std::condition_variable& changed, std::unique_lock<std::mutex>& lock, Done done) {
    if (!asks_here()) return changed.wait(lock, done);
    while (!changed.wait_for(lock, kDoze, done)) {
      lock.unlock();
      ask_when_due();
      lock.lock();
    }
  }

 private:
  static constexpr std::chrono::milliseconds kDoze{10};

  [[nodiscard]] bool asks_here() const { return ask_ && owner_ == std::this_thread::get_id(); }
  void throw_if_stopped();
  void ask_when_due() noexcept;

  const std::function<bool()> ask_;
  const Clock::duration period_;
  std::thread::id owner_;  // of the call; none outside of calls
  Clock::time_point due_;
  std::atomic<bool> stop_{false};
};

}  // namespace espalier::base

/// \file
/// Copies that another thread begins: each costs the runtime some microseconds, which the thread with the messages has
/// not.
#pragma once

#include <atomic>
#include <deque>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

#include "device/cuda/tables/copy_queues.hpp"

namespace espalier::device::cuda {

/// Hands everything to `inner` on a thread of its own, in the order of the calls. All calls by one thread. What fails
/// there is thrown by the next is_done(), and forgotten after finish().
class CopyThread final : public CopyQueues {
 public:
  /// @param inner  outlives this object, which alone uses it
  /// @param begin  called on the thread before all else
  CopyThread(CopyQueues& inner, std::function<void()> begin);
  ~CopyThread() override;
  void copy(Way way, const Rectangle& what) override { push({Command::Kind::copy, way, what, {}}); }
  void pass_on(const PassedOn& what) override { push({Command::Kind::pass_on, Way::to_device, {}, what}); }
  std::uint64_t mark(Way way) override;
  bool is_done(std::uint64_t mark) override;
  void finish() noexcept override;

 private:
  struct Command {
    enum class Kind : std::int8_t { copy, pass_on, mark, finish, end };
    Kind kind;
    Way way;
    Rectangle what;
    PassedOn passed;
  };
  // What the thread alone knows.
  struct Work {
    std::vector<Command> commands;
    std::uint64_t taken = 0;             // commands, of pushed_
    std::deque<std::uint64_t> marks[2];  // of inner_, by way
    std::uint64_t marked[2] = {0, 0};    // so many there were so far
    bool failed = false;
    bool ended = false;
  };

  static std::size_t index(Way way) { return way == Way::to_host ? 0 : 1; }
  void push(const Command& command);
  void work() noexcept;
  bool take_commands(Work& w);
  bool look_at_marks(Work& w);
  void execute(const Command& command, Work& w);
  void finish_inner(Work& w);
  template <class Body>
  void attempt(Work& w, Body&& body) noexcept;

  CopyQueues& inner_;
  std::function<void()> begin_;
  std::mutex mutex_;
  std::vector<Command> commands_;  // guarded by mutex_
  std::exception_ptr failure_;     // guarded by mutex_
  std::atomic<std::uint64_t> pushed_{0}, finished_{0};
  std::atomic<bool> failed_{false};
  std::atomic<std::uint64_t> done_[2] = {0, 0};  // marks, by way
  std::uint64_t marked_[2] = {0, 0};             // of the calling thread
  std::thread thread_;                           // last: all else is there before it
};

}  // namespace espalier::device::cuda

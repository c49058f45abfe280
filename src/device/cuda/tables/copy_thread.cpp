#include "device/cuda/tables/copy_thread.hpp"

#include <utility>

namespace espalier::device::cuda {

namespace {

constexpr int kIdleRounds = 20000;  // some milliseconds: within a run nobody has to wake it

}  // namespace

CopyThread::CopyThread(CopyQueues& inner, std::function<void()> begin)
    : inner_(inner), begin_(std::move(begin)), thread_([this] { work(); }) {}

CopyThread::~CopyThread() {
  push({Command::Kind::end, Way::to_host, {}, {}});
  thread_.join();
}

void CopyThread::push(const Command& command) {
  {
    const std::lock_guard lock(mutex_);
    commands_.push_back(command);
  }
  pushed_.fetch_add(1, std::memory_order_release);
  pushed_.notify_one();
}

// Marks of a way are done in their order, so that a mark is a way and a count.
std::uint64_t CopyThread::mark(Way way) {
  push({Command::Kind::mark, way, {}, {}});
  return 2 * marked_[index(way)]++ + index(way);
}

bool CopyThread::is_done(std::uint64_t mark) {
  if (failed_.load(std::memory_order_acquire)) {
    const std::lock_guard lock(mutex_);
    std::rethrow_exception(failure_);
  }
  return done_[mark % 2].load(std::memory_order_acquire) > mark / 2;
}

void CopyThread::finish() noexcept {
  const std::uint64_t before = finished_.load(std::memory_order_acquire);
  push({Command::Kind::finish, Way::to_host, {}, {}});
  finished_.wait(before, std::memory_order_acquire);
}

void CopyThread::work() noexcept {
  Work w;
  attempt(w, begin_);
  for (int idle = 0; !w.ended;) {
    bool moved = take_commands(w);
    if (look_at_marks(w)) moved = true;
    const bool waits = !w.marks[0].empty() || !w.marks[1].empty();
    idle = moved || waits ? 0 : idle + 1;
    if (idle > kIdleRounds)
      pushed_.wait(w.taken, std::memory_order_acquire);
    else if (!moved)
      std::this_thread::yield();
  }
}

template <class Body>
void CopyThread::attempt(Work& w, Body&& body) noexcept {
  try {
    body();
  } catch (...) {
    w.failed = true;
    const std::lock_guard lock(mutex_);
    failure_ = std::current_exception();
    failed_.store(true, std::memory_order_release);
  }
}

bool CopyThread::take_commands(Work& w) {
  if (pushed_.load(std::memory_order_acquire) == w.taken) return false;
  {
    const std::lock_guard lock(mutex_);
    w.commands.swap(commands_);
  }
  w.taken += w.commands.size();
  for (const Command& c : w.commands) execute(c, w);
  w.commands.clear();
  return true;
}

void CopyThread::execute(const Command& command, Work& w) {
  switch (command.kind) {
    case Command::Kind::copy:
      if (!w.failed) attempt(w, [&] { inner_.copy(command.way, command.what); });
      break;
    case Command::Kind::pass_on:
      if (!w.failed) attempt(w, [&] { inner_.pass_on(command.passed); });
      break;
    case Command::Kind::mark:
      ++w.marked[index(command.way)];
      if (!w.failed) attempt(w, [&] { w.marks[index(command.way)].push_back(inner_.mark(command.way)); });
      break;
    case Command::Kind::finish:
      finish_inner(w);
      finished_.fetch_add(1, std::memory_order_release);
      finished_.notify_one();
      break;
    default:
      finish_inner(w);
      w.ended = true;
  }
}

void CopyThread::finish_inner(Work& w) {
  inner_.finish();
  for (const std::size_t way : {0, 1}) {
    w.marks[way].clear();
    done_[way].store(w.marked[way], std::memory_order_release);
  }
  w.failed = false;
  const std::lock_guard lock(mutex_);
  failure_ = nullptr;
  failed_.store(false, std::memory_order_release);
}

bool CopyThread::look_at_marks(Work& w) {
  bool moved = false;
  for (const std::size_t way : {0, 1}) {
    auto& list = w.marks[way];
    bool done = true;
    while (!w.failed && done && !list.empty()) {
      attempt(w, [&] { done = inner_.is_done(list.front()); });
      if (w.failed || !done) continue;
      list.pop_front();
      done_[way].fetch_add(1, std::memory_order_release);
      moved = true;
    }
  }
  return moved;
}

}  // namespace espalier::device::cuda

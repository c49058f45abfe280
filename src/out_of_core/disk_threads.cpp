// The threads of a store on disk: who reads ahead, and who writes behind.
#include <algorithm>
#include <system_error>

#include "base/forks.hpp"
#include "out_of_core/disk_store.hpp"

namespace espalier::out_of_core {

namespace {

constexpr Index kStepsAhead = 64;  // of a plan, that are read before their time

}  // namespace

// In a child of a fork() the file would be that of the parent, too.
void DiskStore::start_threads() {
  if (base::forks() != forks_)
    throw Error(StatusCode::device_error,
                "a factor on disk does not follow a process into its child (fork); analyze and factorize there");
  stop_ = false;
  failure_ = nullptr;
  try {
    for (int k = 0; k < kReaders; ++k) threads_.emplace_back([this] { guarded([this] { read_ahead(); }); });
    for (int k = 0; k < kWriters; ++k) threads_.emplace_back([this] { guarded([this] { write_behind(); }); });
  } catch (const std::system_error&) {
    end();
    throw Error(StatusCode::out_of_memory,
                "the system refuses the threads that read and write a factor on disk; raise the limit (ulimit -u)");
  }
}

void DiskStore::guarded(const std::function<void()>& work) {
  try {
    work();
  } catch (...) {
    const std::lock_guard lock(mutex_);
    if (failure_ == nullptr) failure_ = std::current_exception();
  }
  tell_all();
}

void DiskStore::write_behind() {
  Lock lock(mutex_);
  // Memory that is to be had without waiting for the disk.
  const std::int64_t enough = std::max<std::int64_t>(kWriters, frames_ / 8);
  while (!stop_ && failure_ == nullptr) {
    std::int64_t ready = frames_ - used_frames_;
    for (const Offset b : in_memory_) {
      const Block& x = block(b);
      if (x.writing || (x.state == State::in_memory && x.pins == 0 && !(x.dirty && has_later_read(b)))) ++ready;
    }
    const Offset b = ready < enough ? farthest(true, -1) : -1;
    if (b >= 0)
      write_block(lock, b);
    else
      work_.wait(lock);
  }
}

void DiskStore::read_ahead() {
  Lock lock(mutex_);
  if (run_ == Run::plan)
    read_plan(lock);
  else
    read_parts(lock);
}

void DiskStore::read_plan(Lock& lock) {
  while (!stop_ && failure_ == nullptr && next_use_ < uses_.size()) {
    const StoreUse& u = uses_[next_use_];
    if (u.step < now() || u.write) {
      ++next_use_;
      continue;
    }
    bool waits = u.step > now() + kStepsAhead;
    for (Offset b = first_block(u.range); b < end_block(u.range) && !waits; ++b) {
      if (block(b).state != State::on_disk) continue;
      if (take_frame(u.step))
        read_block(lock, b);
      else
        waits = true;
    }
    if (stop_ || failure_ != nullptr) return;  // told while a block was read: nobody would tell it again
    if (waits)
      work_.wait(lock);
    else if (&u == &uses_[next_use_])
      ++next_use_;
  }
}

void DiskStore::read_parts(Lock& lock) {
  while (!stop_ && failure_ == nullptr && next_part_ < parts_.size()) {
    const Offset b = first_block(parts_[next_part_]) + next_of_part_;
    if (b >= end_block(parts_[next_part_])) {
      part_state_[next_part_++] = 1;
      next_of_part_ = 0;
      changed_.notify_all();
      continue;
    }
    Block& x = block(b);
    const bool comes = x.state == State::on_disk || x.state == State::empty;
    if (comes && !take_frame(-1)) {
      work_.wait(lock);
      continue;
    }
    ++x.pins;
    ++next_of_part_;
    if (x.state == State::on_disk) {
      read_block(lock, b);
    } else if (x.state == State::empty) {
      map(b);
      x.state = State::in_memory;
      x.dirty = true;
    }
  }
}

}  // namespace espalier::out_of_core

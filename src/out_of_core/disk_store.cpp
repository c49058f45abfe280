#include "out_of_core/disk_store.hpp"

#include <fmt/format.h>
#include <sys/mman.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "base/checksum.hpp"
#include "base/forks.hpp"
#include "base/timeline.hpp"
#include "out_of_core/front_reader.hpp"

namespace espalier::out_of_core {

namespace {

constexpr Offset kHugePage = 2 << 20;

Offset rounded_up(Offset bytes, Offset to) { return (bytes + to - 1) / to * to; }

}  // namespace

// Large ones for the rate of the disk, but some for all who work at the same time.
Offset DiskStore::block_for(Offset window) {
  constexpr Offset kMost = 8 << 20, kLeast = 64 << 10, kBlocks = 64;
  Offset block = kMost;
  while (block > kLeast && window / block < kBlocks) block /= 2;
  return block;
}

DiskStore::DiskStore(Offset bytes, const DiskOptions& options, base::MemoryBudget* budget)
    : bytes_(bytes),
      block_(options.block_bytes > 0 ? options.block_bytes : block_for(options.window_bytes)),
      reserved_(rounded_up(std::max<Offset>(bytes, 1), base::ScratchFile::kAlignment)),
      frames_(std::min(options.window_bytes, rounded_up(bytes, block_)) / block_),
      share_(frames_ * block_, budget),
      forks_(base::forks()) {
  constexpr std::int64_t kLeastFrames = 4;
  if (frames_ < std::min<std::int64_t>(kLeastFrames, (bytes + block_ - 1) / block_))
    throw Error(StatusCode::out_of_memory,
                fmt::format("a window of {} on a factor that is on disk is too small: {} are needed; raise the budget "
                            "(--host-memory)",
                            base::format_bytes(options.window_bytes), base::format_bytes(kLeastFrames * block_)));
  file_ = std::make_unique<base::ScratchFile>(options.folder, std::max<Offset>(0, reserved_ - frames_ * block_));
  const Offset all = reserved_ + kHugePage;
  void* at =
      ::mmap(nullptr, static_cast<std::size_t>(all), PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (at == MAP_FAILED)
    throw Error(StatusCode::out_of_memory,
                fmt::format("the system refuses {} of addresses for a factor on disk: {}; raise the limit (ulimit -v)",
                            base::format_bytes(all), std::strerror(errno)));
  mapped_ = at;
  const auto begin = reinterpret_cast<std::uintptr_t>(at);
  memory_ = static_cast<std::byte*>(at) + (kHugePage - begin % kHugePage) % kHugePage;
  (void)::madvise(memory_, static_cast<std::size_t>(reserved_), MADV_HUGEPAGE);
  blocks_.resize(static_cast<std::size_t>((reserved_ + block_ - 1) / block_));
}

DiskStore::~DiskStore() {
  end();
  if (mapped_ != nullptr) ::munmap(mapped_, static_cast<std::size_t>(reserved_ + kHugePage));
}

// ---- runs -----------------------------------------------------------------------------------------------------------

void DiskStore::set_plan(std::vector<StoreUse> uses, Offset lasts, int queues, Index steps) {
  end();
  steps_.assign(static_cast<std::size_t>(queues), 0);
  uses_ = std::move(uses);
  lasts_ = lasts;
  end_step_ = steps;
  use_at_.assign(blocks_.size(), {});
  last_read_.assign(blocks_.size(), -1);
  for (const StoreUse& u : uses_)
    for (Offset b = first_block(u.range); b < end_block(u.range); ++b) {
      std::vector<Index>& list = use_at_[static_cast<std::size_t>(b)];
      if (list.empty() || list.back() != u.step) list.push_back(u.step);
      if (!u.write) last_read_[static_cast<std::size_t>(b)] = u.step;
    }
}

void DiskStore::begin_plan(bool keep) {
  end();
  if (!keep) {
    const std::vector<Offset> all = in_memory_;
    for (const Offset b : all) {
      block(b).dirty = false;
      drop(b);
    }
    for (Block& b : blocks_) b.state = State::empty;
  }
  std::fill(steps_.begin(), steps_.end(), 0);
  next_use_ = 0;
  run_ = Run::plan;
  start_threads();
}

void DiskStore::begin_parts(std::vector<StoreRange> parts) {
  end();
  parts_ = std::move(parts);
  part_state_.assign(parts_.size(), 0);
  next_part_ = released_ = 0;
  next_of_part_ = 0;
  for (Block& b : blocks_) {
    b.first = kNever;
    b.last = -1;
  }
  for (std::size_t p = 0; p < parts_.size(); ++p) {
    if (end_block(parts_[p]) - first_block(parts_[p]) > frames_)
      throw Error(
          StatusCode::out_of_memory,
          fmt::format("a solve needs {} of a factor on disk in memory at one time, its window has {}; raise the "
                      "budget (--host-memory)",
                      base::format_bytes(parts_[p].bytes + 2 * block_), base::format_bytes(window_bytes())));
    for (Offset b = first_block(parts_[p]); b < end_block(parts_[p]); ++b) {
      block(b).first = std::min(block(b).first, static_cast<Index>(p));
      block(b).last = static_cast<Index>(p);
    }
  }
  run_ = Run::parts;
  start_threads();
}

void DiskStore::end() noexcept {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  tell_all();
  for (std::thread& t : threads_) t.join();
  threads_.clear();
  for (Block& b : blocks_) b.pins = 0;
  run_ = Run::none;
  failure_ = nullptr;
}

void DiskStore::give_up() noexcept {
  {
    const std::lock_guard lock(mutex_);
    if (failure_ == nullptr) failure_ = std::make_exception_ptr(GivenUp{});
  }
  tell_all();
}

void DiskStore::tell_all() {
  changed_.notify_all();
  work_.notify_all();
}

void DiskStore::at_step(int queue, Index step) {
  {
    const std::lock_guard lock(mutex_);
    steps_[static_cast<std::size_t>(queue)] = step;
  }
  work_.notify_all();
}

Index DiskStore::now() const { return *std::min_element(steps_.begin(), steps_.end()); }

void DiskStore::check_failure() const {
  if (failure_ != nullptr) std::rethrow_exception(failure_);
}

// ---- who goes first
// --------------------------------------------------------------------------------------------------

Index DiskStore::next_use(Offset b) const {
  const auto far = static_cast<Index>(b);
  if (run_ == Run::plan) {
    const std::vector<Index>& list = use_at_[static_cast<std::size_t>(b)];
    const auto use = std::lower_bound(list.begin(), list.end(), now());
    if (use != list.end()) return *use;
    return b * block_ < lasts_ ? end_step_ + far : kNever;
  }
  const auto at = static_cast<Index>(released_), all = static_cast<Index>(parts_.size());
  const Block& x = block(b);
  if (x.last < 0) return b * block_ < lasts_ ? 2 * all + far : kNever;
  return x.last >= at ? std::max(x.first, at) : all + (all - 1 - x.last);
}

// Whether what stands there is of use to anybody.
bool DiskStore::has_later_read(Offset b) const {
  return b * block_ < lasts_ || (run_ == Run::plan && last_read_[static_cast<std::size_t>(b)] >= now());
}

// The block in memory that may go, clean or to be written first, and is needed last, after `after`. @returns -1: none
Offset DiskStore::farthest(bool dirty, Index after) const {
  Offset worst = -1;
  Index use = after;
  for (const Offset b : in_memory_) {
    const Block& x = block(b);
    if (x.pins > 0 || x.state != State::in_memory || x.writing || (x.dirty && has_later_read(b)) != dirty) continue;
    const Index next = next_use(b);
    if (next <= use) continue;
    use = next;
    worst = b;
  }
  return worst;
}

bool DiskStore::take_frame(Index after) {
  if (used_frames_ == frames_) {
    const Offset b = farthest(false, after);
    if (b < 0) return false;
    drop(b);
  }
  ++used_frames_;
  return true;
}

void DiskStore::map(Offset b) {
  if (::mprotect(address(b), static_cast<std::size_t>(block_size(b)), PROT_READ | PROT_WRITE) != 0) {
    --used_frames_;
    throw Error(StatusCode::out_of_memory, fmt::format("the system refuses {} of memory for a factor on disk: {}",
                                                       base::format_bytes(block_size(b)), std::strerror(errno)));
  }
  in_memory_.push_back(b);
}

void DiskStore::drop(Offset b) {
  Block& x = block(b);
  (void)::madvise(address(b), static_cast<std::size_t>(block_size(b)), MADV_DONTNEED);
  (void)::mprotect(address(b), static_cast<std::size_t>(block_size(b)), PROT_NONE);
  in_memory_.erase(std::find(in_memory_.begin(), in_memory_.end(), b));
  --used_frames_;
  x.state = x.dirty ? State::empty : State::on_disk;
  x.dirty = false;
}

// ---- blocks ---------------------------------------------------------------------------------------------------------

void DiskStore::wait(Lock& lock) {
  check_failure();
  work_.notify_all();
  ++waiting_;
  changed_.wait(lock);
  --waiting_;
  check_failure();
}

void DiskStore::hold(Offset b, Access access, bool whole) {
  Lock lock(mutex_);
  Block& x = block(b);
  const bool writes = access == Access::write;
  for (;;) {
    if (x.state == State::in_memory && !(writes && x.writing)) break;
    if (x.state == State::in_memory || x.state == State::reading || !take_frame(-1)) {
      wait(lock);
      continue;
    }
    if (x.state == State::on_disk && !(writes && whole)) {
      read_block(lock, b);
      continue;
    }
    map(b);
    x.state = State::in_memory;
    x.dirty = true;
    work_.notify_one();
  }
  ++x.pins;
  x.dirty = x.dirty || writes;
}

void DiskStore::release(Offset b) {
  const std::lock_guard lock(mutex_);
  if (--block(b).pins > 0 || waiting_ == 0) return;
  tell_all();
}

// With a frame that was taken for it.
void DiskStore::read_block(Lock& lock, Offset b) {
  Block& x = block(b);
  map(b);
  x.state = State::reading;
  lock.unlock();
  const double start = base::now_seconds();
  std::exception_ptr failed;
  try {
    file_->read(b * block_, address(b), block_size(b));
    if (base::checksum(address(b), static_cast<std::size_t>(block_size(b))) != x.checksum)
      throw Error(StatusCode::device_error,
                  fmt::format("scratch file: what comes back from bytes {} to {} is not what was written there (their "
                              "checksums differ): the medium, or somebody else, has changed it; factorize again, with "
                              "another folder (--scratch)",
                              b * block_, b * block_ + block_size(b)));
  } catch (...) {
    failed = std::current_exception();
  }
  lock.lock();
  traffic_.read_seconds += base::now_seconds() - start;
  if (failed != nullptr) {
    drop(b);
    x.state = State::on_disk;
    std::rethrow_exception(failed);
  }
  traffic_.read_bytes += block_size(b);
  x.state = State::in_memory;
  x.dirty = false;
  tell_all();
}

void DiskStore::write_block(Lock& lock, Offset b) {
  Block& x = block(b);
  x.writing = true;
  x.dirty = false;
  lock.unlock();
  const double start = base::now_seconds();
  const std::uint64_t sum = base::checksum(address(b), static_cast<std::size_t>(block_size(b)));
  std::exception_ptr failed;
  try {
    file_->write(b * block_, address(b), block_size(b));
  } catch (...) {
    failed = std::current_exception();
  }
  lock.lock();
  traffic_.write_seconds += base::now_seconds() - start;
  x.writing = false;
  if (failed != nullptr) {
    x.dirty = true;
    std::rethrow_exception(failed);
  }
  traffic_.written_bytes += block_size(b);
  x.checksum = sum;
  tell_all();
}

// ---- parts -------------------------------------------------------------------------------------------------------

void DiskStore::need_part(std::size_t part) {
  Lock lock(mutex_);
  const StoreRange& r = parts_[part];
  const auto is_in_memory = [&] {
    if (part_state_[part] == 0) return false;
    for (Offset b = first_block(r); b < end_block(r); ++b)
      if (block(b).state != State::in_memory) return false;
    return true;
  };
  while (!is_in_memory()) wait(lock);
}

void DiskStore::release_part(std::size_t part) {
  bool free = false;
  {
    const std::lock_guard lock(mutex_);
    part_state_[part] = 2;
    for (Offset b = first_block(parts_[part]); b < end_block(parts_[part]); ++b) free = --block(b).pins == 0 || free;
    while (released_ < parts_.size() && part_state_[released_] == 2) ++released_;
  }
  if (free) tell_all();
}

void DiskStore::hold_all(Offset bytes) {
  end();
  const Offset blocks = (bytes + block_ - 1) / block_;
  if (blocks > frames_)
    throw Error(StatusCode::out_of_memory,
                fmt::format("this needs all of a factor on disk in memory: {} more than its window of {}; raise the "
                            "budget (--host-memory)",
                            base::format_bytes(blocks * block_ - window_bytes()), base::format_bytes(window_bytes())));
  for (Offset b = 0; b < blocks; ++b) hold(b, Access::read, false);
}

DiskTraffic DiskStore::traffic() const {
  const std::lock_guard lock(mutex_);
  return traffic_;
}

}  // namespace espalier::out_of_core

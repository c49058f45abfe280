#include "device/host/out_of_core/direct_copies.hpp"

#include <cstring>
#include <stdexcept>

namespace espalier::device::host {

bool PinnedMemory::add(std::byte* at, Offset bytes) {
  const std::lock_guard lock(mutex_);
  const auto next = ranges_.lower_bound(at);
  if (next != ranges_.end() && next->first < at + bytes) return false;
  if (next != ranges_.begin() && std::prev(next)->first + std::prev(next)->second > at) return false;
  ranges_[at] = bytes;
  return true;
}

void PinnedMemory::remove(std::byte* at) noexcept {
  const std::lock_guard lock(mutex_);
  ranges_.erase(at);
}

void PinnedMemory::check(const std::byte* at, Offset bytes) const {
  const std::lock_guard lock(mutex_);
  const auto next = ranges_.upper_bound(at);
  if (next == ranges_.begin() || at + bytes > std::prev(next)->first + std::prev(next)->second)
    throw std::logic_error("out of core: a copy without the ring outside of one pinned block");
}

void PinnedMemory::check_not_torn(const std::byte* at, Offset bytes) const {
  {
    const std::lock_guard lock(mutex_);
    auto next = ranges_.lower_bound(at + bytes);  // those before begin in front of the end
    if (next == ranges_.begin() || std::prev(next)->first + std::prev(next)->second <= at) return;
  }
  check(at, bytes);
}

PinnedMemory& pinned_memory() {
  static PinnedMemory memory;
  return memory;
}

void DirectCopies::begin() {
  for (auto& queue : queues_) queue.clear();
}

void DirectCopies::copy(out_of_core::Queue queue, std::byte* to, const std::byte* from, Offset bytes) {
  if (!late_) {
    std::memcpy(to, from, static_cast<std::size_t>(bytes));
    return;
  }
  const std::lock_guard lock(mutex_);
  queues_[static_cast<std::size_t>(queue)].push_back({0, to, from, bytes});
}

void DirectCopies::mark(out_of_core::Queue queue, std::int64_t number) {
  if (!late_) return;
  const std::lock_guard lock(mutex_);
  for (Copy& c : queues_[static_cast<std::size_t>(queue)])
    if (c.number == 0) c.number = number;
}

void DirectCopies::wait(out_of_core::Queue queue, std::int64_t number) {
  if (!late_) return;
  const std::lock_guard lock(mutex_);
  std::erase_if(queues_[static_cast<std::size_t>(queue)], [&](const Copy& c) {
    if (c.number == 0 || c.number > number) return false;
    std::memcpy(c.to, c.from, static_cast<std::size_t>(c.bytes));
    return true;
  });
}

}  // namespace espalier::device::host

#include "base/spare_memory.hpp"

#include <exception>
#include <utility>

#include "base/memory.hpp"

namespace espalier::base {

namespace {

thread_local SpareMemory* of_this_thread = nullptr;

}  // namespace

SpareMemory::Use::Use(SpareMemory* spare) : before_(std::exchange(of_this_thread, spare)) {}
SpareMemory::Use::~Use() { of_this_thread = before_; }

SpareMemory* SpareMemory::current() { return of_this_thread; }

void* SpareMemory::take(std::size_t bytes) {
  const auto found = blocks_.find(bytes);
  if (found == blocks_.end()) return nullptr;
  void* const block = found->second;
  blocks_.erase(found);
  held_ -= bytes;
  return block;
}

bool SpareMemory::keep(void* block, std::size_t bytes) noexcept {
  if (bytes > limit_ || held_ > limit_ - bytes) return false;
  try {
    blocks_.emplace(bytes, block);
  } catch (const std::exception&) {  // no memory for the list
    return false;
  }
  held_ += bytes;
  return true;
}

void SpareMemory::set_limit(std::size_t bytes) {
  limit_ = bytes;
  if (held_ > limit_) clear();
}

void SpareMemory::clear() noexcept {
  for (const auto& [bytes, block] : blocks_) give_to_machine(block, bytes);
  blocks_.clear();
  held_ = 0;
}

}  // namespace espalier::base

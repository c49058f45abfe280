#include "base/memory.hpp"

#include <fmt/format.h>
#include <sys/mman.h>

#include <algorithm>
#include <bit>
#include <fstream>
#include <new>

#include "base/spare_memory.hpp"
#include "espalier/types.hpp"

namespace espalier::base {

namespace {
constexpr std::size_t kAlignment = 64;
constexpr std::size_t kHugePage = std::size_t{2} << 20;
constexpr std::size_t kHugeFrom = std::size_t{4} << 20;
}  // namespace

void MemoryBudget::take(std::int64_t bytes) {
  const std::int64_t now = held_.fetch_add(bytes, std::memory_order_relaxed) + bytes;
  if (limit_ > 0 && now > limit_) {
    held_.fetch_sub(bytes, std::memory_order_relaxed);
    throw Error(
        StatusCode::out_of_memory,
        fmt::format("{}: {} more are needed, {} are in use, the budget is {}; a budget of "
                    "at least {} would do",
                    name_, format_bytes(bytes), format_bytes(now - bytes), format_bytes(limit_), format_bytes(now)));
  }
  std::int64_t peak = peak_.load(std::memory_order_relaxed);
  while (now > peak && !peak_.compare_exchange_weak(peak, now, std::memory_order_relaxed)) {
  }
}

// Sixteen sizes between powers of two: a sixteenth of the addresses is not used, and so has no pages.
std::size_t kept_size(std::size_t bytes) {
  if (bytes < kHugeFrom) return (bytes + kAlignment - 1) / kAlignment * kAlignment;
  const std::size_t step = std::max(kHugePage, std::bit_floor(bytes) / 16);
  return (bytes + step - 1) / step * step;
}

void* allocate_aligned(std::size_t bytes) {
  const bool huge = bytes >= kHugeFrom;
  const std::size_t alignment = huge ? kHugePage : kAlignment, rounded = kept_size(bytes);
  if (rounded < bytes)
    throw Error(StatusCode::out_of_memory, "an array of more bytes than a pointer can address was asked for");
  SpareMemory* const spare = huge ? SpareMemory::current() : nullptr;
  if (spare != nullptr)
    if (void* const block = spare->take(rounded)) return block;
  void* p = ::operator new (rounded, std::align_val_t{alignment}, std::nothrow);
  if (p == nullptr)
    throw Error(
        StatusCode::out_of_memory,
        fmt::format("the machine refused {} of memory; use a smaller system, or set a memory budget so that the "
                    "factor is kept outside",
                    format_bytes(static_cast<std::int64_t>(bytes))));
  if (huge) (void)madvise(p, rounded, MADV_HUGEPAGE);
  return p;
}

void free_aligned(void* p, std::size_t bytes) noexcept {
  SpareMemory* const spare = p != nullptr && bytes >= kHugeFrom ? SpareMemory::current() : nullptr;
  if (spare == nullptr || !spare->keep(p, kept_size(bytes))) give_to_machine(p, bytes);
}

void give_to_machine(void* p, std::size_t bytes) noexcept {
  ::operator delete (p, std::align_val_t{bytes >= kHugeFrom ? kHugePage : kAlignment});
}

std::int64_t available_memory() {
  std::ifstream file("/proc/meminfo");
  std::string name, unit;
  std::int64_t kilobytes = 0;
  while (file >> name >> kilobytes && std::getline(file, unit))
    if (name == "MemAvailable:") return kilobytes * 1024;
  return 0;
}

std::string format_bytes(std::int64_t bytes) {
  static constexpr const char* kUnits[] = {"B", "KiB", "MiB", "GiB", "TiB", "PiB"};
  double value = static_cast<double>(bytes);
  int unit = 0;
  while (value >= 1024 && unit < 5) {
    value /= 1024;
    ++unit;
  }
  return unit == 0 ? fmt::format("{} B", bytes) : fmt::format("{:.2f} {}", value, kUnits[unit]);
}

}  // namespace espalier::base

/// \file
/// Allocations that are counted, and of which one fails. It replaces operator new of the whole program: one source of
/// it includes this.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <limits>
#include <new>

namespace espalier::test {

inline constexpr long kNever = std::numeric_limits<long>::max();
inline std::atomic<long> allocations_left{kNever};  ///< the allocation that finds 0 fails
inline std::atomic<long> allocations{0};
inline std::atomic<long> bytes_allocated{0};
inline std::atomic<long> held{0};                         ///< allocations that were not given back
inline void* (*plain_malloc)(std::size_t) = std::malloc;  ///< by which operator new takes memory

inline bool refused(std::size_t bytes) {
  allocations.fetch_add(1, std::memory_order_relaxed);
  bytes_allocated.fetch_add(static_cast<long>(bytes), std::memory_order_relaxed);
  if (allocations_left.load(std::memory_order_relaxed) == kNever) return false;
  return allocations_left.fetch_sub(1, std::memory_order_relaxed) == 0;
}

inline void* take(std::size_t bytes, std::size_t alignment) {
  if (refused(bytes)) throw std::bad_alloc();
  const std::size_t rounded = (std::max<std::size_t>(bytes, 1) + alignment - 1) / alignment * alignment;
  void* p = alignment > alignof(std::max_align_t) ? std::aligned_alloc(alignment, rounded) : plain_malloc(rounded);
  if (p == nullptr) throw std::bad_alloc();
  held.fetch_add(1, std::memory_order_relaxed);
  return p;
}

inline void* take_or_null(std::size_t bytes, std::size_t alignment) noexcept {
  try {
    return take(bytes, alignment);
  } catch (const std::bad_alloc&) {
    return nullptr;
  }
}

inline void give_back(void* p) {
  if (p != nullptr) held.fetch_sub(1, std::memory_order_relaxed);
  std::free(p);
}

}  // namespace espalier::test

// Replacements of the whole program; the aligned buffers of base/memory.cpp come through operator new as well. All or
// none may be inlined: a compiler that sees one of a pair takes it for a mismatch.
void* operator new(std::size_t n) { return espalier::test::take(n, 1); }
void* operator new[](std::size_t n) { return espalier::test::take(n, 1); }
void* operator new(std::size_t n, std::align_val_t a) { return espalier::test::take(n, static_cast<std::size_t>(a)); }
void* operator new[](std::size_t n, std::align_val_t a) { return espalier::test::take(n, static_cast<std::size_t>(a)); }
// The aligned buffers and std::stable_sort ask in this way. The sanitizers' own would not come through the ones above.
void* operator new(std::size_t n, const std::nothrow_t&) noexcept { return espalier::test::take_or_null(n, 1); }
void* operator new[](std::size_t n, const std::nothrow_t&) noexcept { return espalier::test::take_or_null(n, 1); }
void* operator new(std::size_t n, std::align_val_t a, const std::nothrow_t&) noexcept {
  return espalier::test::take_or_null(n, static_cast<std::size_t>(a));
}
[[gnu::noinline]] void operator delete(void* p) noexcept { espalier::test::give_back(p); }
[[gnu::noinline]] void operator delete[](void* p) noexcept { espalier::test::give_back(p); }
[[gnu::noinline]] void operator delete(void* p, std::size_t) noexcept { espalier::test::give_back(p); }
[[gnu::noinline]] void operator delete[](void* p, std::size_t) noexcept { espalier::test::give_back(p); }
[[gnu::noinline]] void operator delete(void* p, const std::nothrow_t&) noexcept { espalier::test::give_back(p); }
[[gnu::noinline]] void operator delete[](void* p, const std::nothrow_t&) noexcept { espalier::test::give_back(p); }
[[gnu::noinline]] void operator delete(void* p, std::align_val_t) noexcept { espalier::test::give_back(p); }
[[gnu::noinline]] void operator delete[](void* p, std::align_val_t) noexcept { espalier::test::give_back(p); }
[[gnu::noinline]] void operator delete(void* p, std::size_t, std::align_val_t) noexcept {
  espalier::test::give_back(p);
}
[[gnu::noinline]] void operator delete[](void* p, std::size_t, std::align_val_t) noexcept {
  espalier::test::give_back(p);
}

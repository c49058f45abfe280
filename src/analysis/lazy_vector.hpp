/// \file
/// A vector for large arrays that are written in full before they are read.
#pragma once

#include <cstddef>
#include <memory>
#include <type_traits>
#include <utility>
#include <vector>

#include "base/memory.hpp"

namespace espalier::analysis {

/// Leaves new elements uninitialised and takes huge pages for large arrays. Clearing them by one thread took an eighth
/// of the analysis (elasticity 40^3), most of it in page faults.
template <class T>
struct LazyAllocator {
  using value_type = T;
  LazyAllocator() = default;
  template <class U>
  LazyAllocator(const LazyAllocator<U>&) noexcept {}  // NOLINT(google-explicit-constructor): as the standard wants it
  T* allocate(std::size_t n) { return static_cast<T*>(base::allocate_aligned(n * sizeof(T))); }
  void deallocate(T* p, std::size_t n) noexcept { base::free_aligned(p, n * sizeof(T)); }
  template <class U, class... Args>
  void construct(U* p, Args&&... args) {
    // Elements that are copied byte by byte come to life with their first value.
    if constexpr (sizeof...(Args) > 0 || !std::is_trivially_copyable_v<U>)
      std::construct_at(p, std::forward<Args>(args)...);
  }
  friend bool operator==(const LazyAllocator&, const LazyAllocator&) { return true; }
};

template <class T>
using LazyVector = std::vector<T, LazyAllocator<T>>;

}  // namespace espalier::analysis

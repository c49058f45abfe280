/// \file
/// A vector whose numbers are not initialised when it is made or grows: memory that is written for the first time is
/// slow, and threads that fill a large array in pieces share that work.
#pragma once

#include <memory>
#include <type_traits>
#include <utility>
#include <vector>

namespace espalier::base {

template <class T>
class UntouchedAllocator : public std::allocator<T> {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  template <class U>
  struct rebind {                         // NOLINT(readability-identifier-naming): the standard's name
    using other = UntouchedAllocator<U>;  // NOLINT(readability-identifier-naming)
  };
  UntouchedAllocator() = default;
  template <class U>
  explicit UntouchedAllocator(const UntouchedAllocator<U>&) noexcept {}
  /// Leaves what resize() adds as it is found.
  template <class U>
  void construct(U* p) noexcept {
    ::new (static_cast<void*>(p)) U;
  }
  template <class U, class... Values>
  void construct(U* p, Values&&... values) {
    ::new (static_cast<void*>(p)) U(std::forward<Values>(values)...);
  }
};

template <class T>
using UntouchedVector = std::vector<T, UntouchedAllocator<T>>;

}  // namespace espalier::base

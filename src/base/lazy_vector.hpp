/// \file
/// A vector for large arrays that are written in full before they are read.
#pragma once

#include <algorithm>
#include <cstddef>
#include <initializer_list>
#include <iterator>
#include <type_traits>
#include <utility>

#include "base/memory.hpp"

namespace espalier::base {

/// As std::vector, but leaves new elements uninitialised and takes huge pages for large arrays. Clearing them by one
/// thread took an eighth of the analysis (elasticity 40^3), most of it in page faults; and where the optimizer does
/// little (-O1), std::vector with an allocator of its own visits each element when it ends, 10 ms for 30 million.
template <class T>
class LazyVector {
  static_assert(std::is_trivially_copyable_v<T> && std::is_trivially_destructible_v<T>);

 public:
  using value_type = T;             // NOLINT(readability-identifier-naming): the standard's names
  using iterator = T*;              // NOLINT(readability-identifier-naming)
  using const_iterator = const T*;  // NOLINT(readability-identifier-naming)

  LazyVector() = default;
  explicit LazyVector(std::size_t size) { resize(size); }
  LazyVector(std::size_t size, const T& value) { assign(size, value); }
  template <std::input_iterator Iterator>
  LazyVector(Iterator first, Iterator last) {
    assign(first, last);
  }
  LazyVector(std::initializer_list<T> list) { assign(list.begin(), list.end()); }
  LazyVector(const LazyVector& o) { assign(o.begin(), o.end()); }
  LazyVector(LazyVector&& o) noexcept { swap(o); }
  LazyVector& operator=(const LazyVector& o) {
    if (this != &o) assign(o.begin(), o.end());
    return *this;
  }
  LazyVector& operator=(LazyVector&& o) noexcept {
    LazyVector(std::move(o)).swap(*this);
    return *this;
  }
  ~LazyVector() {
    if (data_ != nullptr) free_aligned(data_, capacity_ * sizeof(T));
  }

  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] std::size_t capacity() const { return capacity_; }
  [[nodiscard]] bool empty() const { return size_ == 0; }
  [[nodiscard]] T* data() { return data_; }
  [[nodiscard]] const T* data() const { return data_; }
  [[nodiscard]] T* begin() { return data_; }
  [[nodiscard]] T* end() { return data_ + size_; }
  [[nodiscard]] const T* begin() const { return data_; }
  [[nodiscard]] const T* end() const { return data_ + size_; }
  [[nodiscard]] T& operator[](std::size_t k) { return data_[k]; }
  [[nodiscard]] const T& operator[](std::size_t k) const { return data_[k]; }
  [[nodiscard]] T& back() { return data_[size_ - 1]; }
  [[nodiscard]] const T& back() const { return data_[size_ - 1]; }

  void reserve(std::size_t capacity) {
    if (capacity <= capacity_) return;
    T* const larger = static_cast<T*>(allocate_aligned(capacity * sizeof(T)));
    std::copy_n(data_, size_, larger);
    if (data_ != nullptr) free_aligned(data_, capacity_ * sizeof(T));
    data_ = larger;
    capacity_ = capacity;
  }
  void resize(std::size_t size) {
    reserve(size);
    size_ = size;
  }
  void clear() { size_ = 0; }
  void assign(std::size_t size, const T& value) {
    const T kept = value;
    resize(size);
    std::fill_n(data_, size, kept);
  }
  template <std::input_iterator Iterator>
  void assign(Iterator first, Iterator last) {
    resize(static_cast<std::size_t>(std::distance(first, last)));
    std::copy(first, last, data_);
  }
  void push_back(const T& value) {
    const T kept = value;
    if (size_ == capacity_) reserve(std::max<std::size_t>(16, 2 * capacity_));
    data_[size_++] = kept;
  }
  void append(std::initializer_list<T> list) { append(list.begin(), list.end()); }
  /// @param first  not of this vector
  template <std::input_iterator Iterator>
  void append(Iterator first, Iterator last) {
    const std::size_t before = size_, more = static_cast<std::size_t>(std::distance(first, last));
    if (before + more > capacity_) reserve(std::max(before + more, 2 * capacity_));
    size_ += more;
    std::copy(first, last, data_ + before);
  }
  void swap(LazyVector& o) noexcept {
    std::swap(data_, o.data_);
    std::swap(size_, o.size_);
    std::swap(capacity_, o.capacity_);
  }
  friend bool operator==(const LazyVector& a, const LazyVector& b) {
    return std::equal(a.begin(), a.end(), b.begin(), b.end());
  }

 private:
  T* data_ = nullptr;
  std::size_t size_ = 0, capacity_ = 0;
};

}  // namespace espalier::base

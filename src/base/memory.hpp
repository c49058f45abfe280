/// \file
/// Aligned buffers that are counted against a budget.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <type_traits>
#include <utility>

#include "base/at.hpp"

namespace espalier::base {

/// Counts the bytes of all buffers that were taken from it and refuses to pass its limit. Thread-safe.
class MemoryBudget {
 public:
  /// @param name appears in error messages, for instance "host memory"
  /// @param limit_bytes 0: no limit but the machine's
  explicit MemoryBudget(std::string name, std::int64_t limit_bytes = 0) : name_(std::move(name)), limit_(limit_bytes) {}
  /// Counts `bytes` more. @throws Error(out_of_memory) naming the budget needed when the limit would be passed
  void take(std::int64_t bytes);
  void give_back(std::int64_t bytes) { held_.fetch_sub(bytes, std::memory_order_relaxed); }
  [[nodiscard]] std::int64_t held() const { return held_.load(std::memory_order_relaxed); }
  [[nodiscard]] std::int64_t peak() const { return peak_.load(std::memory_order_relaxed); }
  [[nodiscard]] std::int64_t limit() const { return limit_; }
  [[nodiscard]] const std::string& name() const { return name_; }

 private:
  std::string name_;
  std::int64_t limit_;
  std::atomic<std::int64_t> held_{0};
  std::atomic<std::int64_t> peak_{0};
};

/// Takes `bytes` (64-byte aligned, not initialised; transparent huge pages from 4 MiB on) from the machine, or, of such
/// pages, from the thread's SpareMemory.
/// @throws Error(out_of_memory)
void* allocate_aligned(std::size_t bytes);
void free_aligned(void* p, std::size_t bytes) noexcept;
/// Past the SpareMemory. @param bytes  of the block: kept_size() of those that were asked for
void give_to_machine(void* p, std::size_t bytes) noexcept;
/// What an array of so many bytes takes: large ones have one of few sizes, so that others fit in their place.
std::size_t kept_size(std::size_t bytes);

/// An array of trivially copyable T, 64-byte aligned, not initialised, counted in a budget (may be null).
template <class T>
class Buffer {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  Buffer() = default;
  Buffer(std::int64_t size, MemoryBudget* budget) : size_(size), budget_(budget) {
    if (size == 0) return;
    if (budget_ != nullptr) budget_->take(bytes());
    try {
      data_ = static_cast<T*>(allocate_aligned(static_cast<std::size_t>(bytes())));
    } catch (...) {
      if (budget_ != nullptr) budget_->give_back(bytes());
      throw;
    }
  }
  Buffer(Buffer&& o) noexcept
      : data_(std::exchange(o.data_, nullptr)), size_(std::exchange(o.size_, 0)), budget_(o.budget_) {}
  Buffer& operator=(Buffer&& o) noexcept {
    std::swap(data_, o.data_);
    std::swap(size_, o.size_);
    std::swap(budget_, o.budget_);
    return *this;
  }
  Buffer(const Buffer&) = delete;
  Buffer& operator=(const Buffer&) = delete;
  ~Buffer() {
    if (data_ == nullptr) return;
    free_aligned(data_, static_cast<std::size_t>(bytes()));
    if (budget_ != nullptr) budget_->give_back(bytes());
  }

  [[nodiscard]] T* data() { return data_; }
  [[nodiscard]] const T* data() const { return data_; }
  [[nodiscard]] std::int64_t size() const { return size_; }
  [[nodiscard]] std::int64_t bytes() const { return size_ * static_cast<std::int64_t>(sizeof(T)); }
  T& operator[](std::int64_t i) { return data_[i]; }
  const T& operator[](std::int64_t i) const { return data_[i]; }
  T* begin() { return data_; }
  T* end() { return data_ + size_; }
  [[nodiscard]] std::span<T> span() { return {data_, at(size_)}; }

 private:
  T* data_ = nullptr;
  std::int64_t size_ = 0;
  MemoryBudget* budget_ = nullptr;
};

/// Bytes of a budget that count as taken as long as this stands for them.
class BudgetShare {
 public:
  BudgetShare() = default;
  /// @param budget  may be null
  BudgetShare(std::int64_t bytes, MemoryBudget* budget) : bytes_(bytes), budget_(budget) {
    if (budget_ != nullptr) budget_->take(bytes_);
  }
  BudgetShare(BudgetShare&& o) noexcept : bytes_(std::exchange(o.bytes_, 0)), budget_(o.budget_) {}
  BudgetShare& operator=(BudgetShare&& o) noexcept {
    std::swap(bytes_, o.bytes_);
    std::swap(budget_, o.budget_);
    return *this;
  }
  BudgetShare(const BudgetShare&) = delete;
  BudgetShare& operator=(const BudgetShare&) = delete;
  /// @throws Error(out_of_memory); nothing has changed then
  void grow(std::int64_t bytes) {
    if (budget_ != nullptr) budget_->take(bytes);
    bytes_ += bytes;
  }
  ~BudgetShare() {
    if (budget_ != nullptr) budget_->give_back(bytes_);
  }

 private:
  std::int64_t bytes_ = 0;
  MemoryBudget* budget_ = nullptr;
};

/// Bytes of the machine's memory that programs can still have; 0: it does not tell.
std::int64_t available_memory();

/// "1.5 GiB", "640 B": for messages.
std::string format_bytes(std::int64_t bytes);

}  // namespace espalier::base

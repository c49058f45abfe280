/// \file
/// The linear system in memory that the benchmark and the rivals' processes share.
#pragma once

#include <cstddef>
#include <span>

#include "rivals/system_view.hpp"

namespace espalier::bench {

/// A mapping of anonymous shared memory (memfd), all its pages resident from the start; closed and unmapped by the
/// destructor.
class SharedMemory {
 public:
  /// New zeroed memory of `bytes` bytes. Throws std::system_error.
  explicit SharedMemory(std::size_t bytes);
  /// Memory that another process made, known by its file descriptor (which this object closes).
  static SharedMemory adopt(int descriptor);
  SharedMemory(SharedMemory&& other) noexcept;
  SharedMemory& operator=(SharedMemory&& other) noexcept;
  ~SharedMemory();

  [[nodiscard]] int descriptor() const { return descriptor_; }
  [[nodiscard]] std::span<std::byte> bytes() const { return {data_, size_}; }

 private:
  SharedMemory() = default;
  void map();

  int descriptor_ = -1;
  std::byte* data_ = nullptr;
  std::size_t size_ = 0;
};

/// Matrix, right-hand sides and current values. The benchmark writes, the rivals read.
class SharedSystem {
 public:
  /// Copies `a` and reserves `columns` right-hand sides.
  SharedSystem(const SystemView& a, Index columns);
  explicit SharedSystem(SharedMemory memory) : memory_(std::move(memory)) {}

  [[nodiscard]] SystemView matrix() const;
  /// parts() * nonzeros() values; those of matrix()
  [[nodiscard]] std::span<double> values() const;
  /// parts() * rows * columns values, column by column
  [[nodiscard]] std::span<double> right_hand_sides() const;
  [[nodiscard]] int descriptor() const { return memory_.descriptor(); }

 private:
  struct Header;
  [[nodiscard]] Header& header() const;

  SharedMemory memory_;
};

}  // namespace espalier::bench

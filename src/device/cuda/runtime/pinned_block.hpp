/// \file
/// Blocks of pinned host memory that the process keeps. For this backend alone: needs the CUDA runtime.
#pragma once

#include "device/cuda/runtime/device_memory.hpp"

namespace espalier::device::cuda {

/// A block that all GPUs see, through which large tables go. Pinning takes 0.4 ms per MiB, which a first factorization
/// of a small system would feel; so blocks are kept when their owner has gone, and can be made beforehand.
class PinnedBlock {
 public:
  static constexpr Offset kBytes = Offset{4} << 20;

  /// Takes a block that is kept, or makes one.
  PinnedBlock();
  PinnedBlock(const PinnedBlock&) = delete;
  PinnedBlock& operator=(const PinnedBlock&) = delete;
  /// @pre nothing is being copied from or to it
  ~PinnedBlock();
  [[nodiscard]] std::byte* data() const { return block_.data(); }

  /// Makes blocks until so many are kept. What fails here fails again where a block is needed.
  static void keep_ready(std::size_t count) noexcept;

 private:
  PinnedArray<std::byte> block_;
};

}  // namespace espalier::device::cuda

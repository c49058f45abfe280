/// \file
/// Memory for messages that copy engines reach, in slots that come back by themselves.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "device/cuda/runtime/device_memory.hpp"

namespace espalier::device::cuda {

/// Slots of one size, all taken at the beginning: the runtime gives no memory while kernels run. One thread uses them.
class PinnedSlots : public std::enable_shared_from_this<PinnedSlots> {
 public:
  /// @throws Error(out_of_memory)
  PinnedSlots(std::size_t slots, std::size_t bytes) : bytes_(bytes), memory_(static_cast<Offset>(slots * bytes)) {
    for (std::size_t k = slots; k-- > 0;) free_.push_back(memory_.data() + k * bytes);
  }

  [[nodiscard]] std::size_t bytes() const { return bytes_; }
  [[nodiscard]] std::size_t left() const { return free_.size(); }
  /// A slot, until nobody holds it any more; null: none is left, or they are smaller.
  [[nodiscard]] std::shared_ptr<std::byte[]> take(std::size_t bytes) {
    if (free_.empty() || bytes > bytes_) return nullptr;
    std::byte* const slot = free_.back();
    free_.pop_back();
    return {slot, [self = shared_from_this()](std::byte* back) { self->free_.push_back(back); }};
  }

 private:
  std::size_t bytes_;
  PinnedArray<std::byte> memory_;
  std::vector<std::byte*> free_;
};

}  // namespace espalier::device::cuda

/// \file
/// Memory for messages that copy engines reach, in slots that come back by themselves.
#pragma once

#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

namespace espalier::device::cuda {

/// Slots of one size, all taken at the beginning: no memory is to be had while kernels run. One thread uses them.
class MessageSlots : public std::enable_shared_from_this<MessageSlots> {
 public:
  /// @param memory  slots x bytes, kept as long as somebody holds a slot
  MessageSlots(std::shared_ptr<std::byte[]> memory, std::size_t slots, std::size_t bytes)
      : memory_(std::move(memory)), slots_(slots), bytes_(bytes) {
    for (std::size_t k = slots; k-- > 0;) free_.push_back(memory_.get() + k * bytes);
  }

  [[nodiscard]] std::size_t bytes() const { return bytes_; }
  [[nodiscard]] std::size_t size() const { return slots_; }
  [[nodiscard]] std::size_t left() const { return free_.size(); }
  /// A slot, until nobody holds it any more; null: none is left, or they are smaller.
  [[nodiscard]] std::shared_ptr<std::byte[]> take(std::size_t bytes) {
    if (free_.empty() || bytes > bytes_) return nullptr;
    std::byte* const slot = free_.back();
    free_.pop_back();
    return {slot, [self = shared_from_this()](std::byte* back) { self->free_.push_back(back); }};
  }

 private:
  std::shared_ptr<std::byte[]> memory_;
  std::size_t slots_, bytes_;
  std::vector<std::byte*> free_;
};

}  // namespace espalier::device::cuda

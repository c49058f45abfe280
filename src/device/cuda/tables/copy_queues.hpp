/// \file
/// What an exchange between machines asks of whoever copies. As plain C++.
#pragma once

#include <cstddef>
#include <cstdint>

namespace espalier::device::cuda {

enum class Way : std::int8_t { to_host, to_device };

/// Copies between a device, its host and devices that it reaches, while kernels run; each way in the order in which
/// they were begun.
class CopyQueues {
 public:
  /// `rows` stretches of `row_bytes` each: one after another on the host, `pitch` bytes apart on the device.
  struct Rectangle {
    std::byte* host;
    std::byte* device;
    std::size_t pitch, row_bytes, rows;
  };
  /// The same from one device to another, laid out alike on both.
  struct PassedOn {
    const std::byte* from;
    std::byte* to;
    std::size_t pitch, row_bytes, rows;
  };

  CopyQueues() = default;
  CopyQueues(const CopyQueues&) = delete;
  CopyQueues& operator=(const CopyQueues&) = delete;
  virtual ~CopyQueues() = default;

  virtual void copy(Way way, const Rectangle& what) = 0;
  /// From this device to one that it reaches: a copy of Way::to_device, so after what was brought here before.
  virtual void pass_on(const PassedOn& what) = 0;
  /// Marks what has been begun that way. @returns a number for is_done()
  virtual std::uint64_t mark(Way way) = 0;
  /// Whether all that was begun before the mark is there; then the number is not used again.
  virtual bool is_done(std::uint64_t mark) = 0;
  /// Waits until all is there. Marks are no longer valid.
  virtual void finish() noexcept = 0;
};

}  // namespace espalier::device::cuda

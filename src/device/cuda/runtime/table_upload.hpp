/// \file
/// Sends large tables of the host to a GPU, and fetches them: all threads fill, or read, a pinned buffer while another
/// one is on the link. A copy of pageable memory goes through one thread of the driver, at 6 to 10 instead of 50 GB/s.
/// For this backend alone: needs the CUDA runtime.
#pragma once

#include <algorithm>
#include <cstring>
#include <functional>
#include <memory>
#include <vector>

#include "base/thread_pool.hpp"
#include "device/cuda/runtime/device_memory.hpp"
#include "device/cuda/runtime/pinned_block.hpp"

namespace espalier::device::cuda {

/// For one GPU, which must be current in every call.
class TableUpload {
 public:
  /// Writes elements [first, end) of a table to `stage`.
  using Fill = std::function<void(std::byte* stage, Offset first, Offset end)>;

  /// Reads elements [first, end) of a table from `stage`.
  using Read = std::function<void(const std::byte* stage, Offset first, Offset end)>;

  /// @param pool  outlives the object; null: the calling thread alone
  explicit TableUpload(base::ThreadPool* pool) : pool_(pool) {}

  /// Enqueues the copy of `bytes`; `from` may change when it returns.
  void copy(void* to, const void* from, Offset bytes, cudaStream_t stream) {
    if (bytes < kDirect) return enqueue(to, from, bytes, stream);
    const auto* source = static_cast<const std::byte*>(from);
    make(to, bytes, 1, stream, [source](std::byte* stage, Offset first, Offset end) {
      std::memcpy(stage, source + first, static_cast<std::size_t>(end - first));
    });
  }

  /// Enqueues a table of `count` elements of so many bytes, a power of two, that `fill` makes.
  void make(void* to, Offset count, Offset element, cudaStream_t stream, const Fill& fill) {
    const Offset each = kBuffer / element;
    if (count * element < kDirect) {
      std::vector<std::byte> stage(static_cast<std::size_t>(count * element));
      fill(stage.data(), 0, count);
      return enqueue(to, stage.data(), count * element, stream);
    }
    open();
    for (Offset first = 0; first < count; first += each) {
      const Offset now = std::min(each, count - first);
      Buffer& b = *buffers_[turn_ = 1 - turn_];
      b.sent.wait();
      by_all(now, element,
             [&](Offset begin, Offset end) { fill(b.data.data() + begin * element, first + begin, first + end); });
      enqueue(static_cast<std::byte*>(to) + first * element, b.data.data(), now * element, stream);
      b.sent.record(stream);
    }
  }

  /// Has a table of `count` elements of so many bytes read when the stream's work is done. Waits.
  void fetch(const void* from, Offset count, Offset element, cudaStream_t stream, const Read& read) {
    const auto* source = static_cast<const std::byte*>(from);
    if (count * element < kDirect) {
      std::vector<std::byte> stage(static_cast<std::size_t>(count * element));
      enqueue(stage.data(), source, count * element, stream);
      call("cudaStreamSynchronize", [&] { return cudaStreamSynchronize(stream); });
      return read(stage.data(), 0, count);
    }
    open();
    const Offset each = kBuffer / element;
    const auto read_part = [&](Buffer& b, Offset first) {
      b.sent.wait();
      by_all(std::min(each, count - first), element,
             [&](Offset begin, Offset end) { read(b.data.data() + begin * element, first + begin, first + end); });
    };
    for (Offset first = 0; first < count; first += each) {
      Buffer& b = *buffers_[turn_ = 1 - turn_];
      b.sent.wait();
      enqueue(b.data.data(), source + first * element, std::min(each, count - first) * element, stream);
      b.sent.record(stream);
      if (first > 0) read_part(*buffers_[1 - turn_], first - each);
    }
    read_part(*buffers_[turn_], (count - 1) / each * each);
  }

 private:
  static constexpr Offset kBuffer = PinnedBlock::kBytes;
  static constexpr Offset kDirect = Offset{4} << 20;            // smaller tables are not worth the buffers
  static constexpr Offset kBytesPerThread = Offset{256} << 10;  // bytes that one thread fills at a time

  struct Buffer {
    Buffer() = default;
    Buffer(const Buffer&) = delete;
    Buffer& operator=(const Buffer&) = delete;
    ~Buffer() { (void)cudaEventSynchronize(sent.get()); }
    PinnedBlock data;
    Event sent;
  };

  void open() {
    for (auto& b : buffers_)
      if (!b) b = std::make_unique<Buffer>();
  }
  // use(begin, end) for ranges of `count` elements.
  template <class Use>
  void by_all(Offset count, Offset element, Use&& use) {
    if (pool_ == nullptr) return use(Offset{0}, count);
    pool_->for_each_range(count, kBytesPerThread / element, use);
  }
  static void enqueue(void* to, const void* from, Offset bytes, cudaStream_t stream) {
    if (bytes == 0) return;
    call("cudaMemcpyAsync(tables)",
         [&] { return cudaMemcpyAsync(to, from, static_cast<std::size_t>(bytes), cudaMemcpyDefault, stream); });
  }

  base::ThreadPool* pool_;
  std::unique_ptr<Buffer> buffers_[2];
  int turn_ = 0;
};

}  // namespace espalier::device::cuda

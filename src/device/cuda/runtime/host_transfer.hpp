/// \file
/// Copies between the caller's pageable memory and a GPU through two pinned buffers: while one is on the link, the host
/// fills the other. For this backend alone: needs the CUDA runtime.
#pragma once

#include <algorithm>
#include <memory>

#include "device/cuda/runtime/device_memory.hpp"
#include "device/device_linear_system.hpp"

namespace espalier::device::cuda {

class HostTransfer {
 public:
  /// @param buffer_size  doubles in each buffer; taken when first needed
  explicit HostTransfer(Offset buffer_size) : buffer_size_(buffer_size) {}

  /// Enqueues the copy to the device; `from` may change when it returns.
  void send(double* to, const double* from, Offset count, cudaStream_t stream, const HostCopy& copy) {
    send_made(to, count, stream, [&](Offset at, Offset now, double* stage) { copy(stage, from + at, now); });
  }
  /// The same of numbers that make(first, count, stage) writes into pinned memory, part by part.
  template <class Make>
  void send_made(double* to, Offset count, cudaStream_t stream, const Make& make) {
    open();
    for (Offset at = 0; at < count; at += buffer_size_) {
      const Offset now = std::min(buffer_size_, count - at);
      double* stage = next();
      make(at, now, stage);
      enqueue(to + at, stage, now, cudaMemcpyHostToDevice, stream);
    }
  }
  /// Copies from the device when the stream's work is done, and waits for it.
  void fetch(double* to, const double* from, Offset count, cudaStream_t stream, const HostCopy& copy) {
    open();
    double* before = nullptr;
    for (Offset at = 0; at < count; at += buffer_size_) {
      double* stage = next();
      enqueue(stage, from + at, std::min(buffer_size_, count - at), cudaMemcpyDeviceToHost, stream);
      if (before != nullptr) take(to + at - buffer_size_, before, buffer_size_, copy);
      before = stage;
    }
    const Offset last = (count - 1) / buffer_size_ * buffer_size_;
    if (before != nullptr) take(to + last, before, count - last, copy);
  }

 private:
  struct Half {
    explicit Half(Offset size) : data(size) {}
    PinnedArray<double> data;
    Event done;  // of the copy that last used it
  };

  void open() {
    for (auto& half : halves_)
      if (!half) half = std::make_unique<Half>(buffer_size_);
  }
  // The buffer that is free, or becomes so first.
  double* next() {
    turn_ = 1 - turn_;
    halves_[turn_]->done.wait();
    return halves_[turn_]->data.data();
  }
  void enqueue(double* to, const double* from, Offset count, cudaMemcpyKind kind, cudaStream_t stream) {
    call("cudaMemcpyAsync(through pinned memory)",
         [&] { return cudaMemcpyAsync(to, from, static_cast<std::size_t>(count) * sizeof(double), kind, stream); });
    halves_[turn_]->done.record(stream);
  }
  void take(double* to, const double* stage, Offset count, const HostCopy& copy) {
    const int k = stage == halves_[0]->data.data() ? 0 : 1;
    halves_[k]->done.wait();
    copy(to, stage, count);
  }

  Offset buffer_size_;
  std::unique_ptr<Half> halves_[2];
  int turn_ = 0;
};

}  // namespace espalier::device::cuda

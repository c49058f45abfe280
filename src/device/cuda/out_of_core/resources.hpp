/// \file
/// CUDA streams, events and memory of a GPU that works out of core. Needs the CUDA runtime.
#pragma once

#include <cuda_runtime_api.h>

#include <array>
#include <vector>

#include "device/cuda/out_of_core/backend.hpp"
#include "out_of_core/plan.hpp"

namespace espalier::device::cuda {

/// Everything is released without throwing.
class Resources {
 public:
  explicit Resources(const CudaOutOfCoreOptions& options) : options_(options) {}
  Resources(const Resources&) = delete;
  Resources& operator=(const Resources&) = delete;
  ~Resources();

  /// @param marks  events of each queue
  /// @throws AllocationRefused
  void take(Offset arena_bytes, int slots, Offset slot_bytes,
            const std::array<std::size_t, out_of_core::kQueues>& marks);

  [[nodiscard]] std::byte* arena() const { return arena_; }
  [[nodiscard]] Offset arena_bytes() const { return arena_ != nullptr ? arena_bytes_ : 0; }
  [[nodiscard]] std::byte* slot(int k) const { return ring_ + k * slot_bytes_; }
  [[nodiscard]] cudaStream_t stream(out_of_core::Queue q) const { return streams_[static_cast<std::size_t>(q)]; }
  [[nodiscard]] cudaEvent_t mark(out_of_core::Queue q, std::int64_t number) const {
    return marks_[static_cast<std::size_t>(q)][static_cast<std::size_t>(number - 1)];
  }
  /// Marks the start of operation `number` of a queue that computes; its mark is the end.
  [[nodiscard]] cudaEvent_t start(out_of_core::Queue q, std::int64_t number) const {
    return starts_[static_cast<std::size_t>(q)][static_cast<std::size_t>(number - 1)];
  }
  [[nodiscard]] cudaEvent_t slot_event(int k) const { return slots_[static_cast<std::size_t>(k)]; }
  [[nodiscard]] int device() const { return options_.device; }
  /// Whether kernels read pinned memory by the address that the host has for it.
  [[nodiscard]] bool reads_pinned_memory() const;

 private:
  template <class Make>
  void allocate(const char* name, Make&& make);
  static void make_events(std::vector<cudaEvent_t>& list, std::size_t count, unsigned flags);

  CudaOutOfCoreOptions options_;
  Offset arena_bytes_ = 0, slot_bytes_ = 0;
  std::byte* arena_ = nullptr;
  std::byte* ring_ = nullptr;
  std::array<cudaStream_t, out_of_core::kQueues> streams_{};
  std::array<std::vector<cudaEvent_t>, out_of_core::kQueues> marks_, starts_;
  std::vector<cudaEvent_t> slots_;
};

}  // namespace espalier::device::cuda

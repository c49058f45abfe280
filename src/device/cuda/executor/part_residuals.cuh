/// \file
/// What the host and a GPU tell each other of the parts of a block-diagonal system. For device_linear_system.cu alone.
#pragma once

#include <algorithm>
#include <span>

#include "device/cuda/kernels/part_kernels.cuh"
#include "device/cuda/runtime/device_memory.hpp"

namespace espalier::device::cuda {

/// Launches on one stream, whose device is current.
class PartResiduals {
 public:
  /// @param short_rows  see LinearSystemMemory
  void enqueue(const DevicePattern& pattern, bool short_rows, const ResidualColumns& columns, bool transpose,
               Index parts, cudaStream_t stream) {
    const Offset numbers = Offset{parts} * columns.columns * ResidualSizes::kCount;
    if (found_.size() < numbers) found_ = PinnedArray<double>(numbers);
    const PartResidualJob job{columns.b, columns.x, columns.r, pattern.n / parts, transpose, found_.data()};
    const dim3 blocks(static_cast<unsigned>(parts), static_cast<unsigned>(columns.columns));
    if (short_rows)
      part_residual_kernel<2><<<blocks, kSystemThreads, 0, stream>>>(pattern, job);
    else
      part_residual_kernel<4><<<blocks, kSystemThreads, 0, stream>>>(pattern, job);
    call("launch of the residual kernel of parts", [&] { return cudaGetLastError(); });
  }
  /// What the last one found, once the stream is done: columns x parts x ResidualSizes.
  [[nodiscard]] const double* found() const { return found_.data(); }

  void enqueue_copy(const double* from, double* to, Index rows, std::span<const char> taken, cudaStream_t stream) {
    copied_.wait();  // the copy before has read its list
    const auto parts = static_cast<Offset>(taken.size());
    if (taken_.size() < parts) taken_ = PinnedArray<char>(parts);
    std::copy(taken.begin(), taken.end(), taken_.data());
    copy_parts_kernel<<<static_cast<unsigned>(parts), kSystemThreads, 0, stream>>>(rows, taken_.data(), from, to);
    call("launch of the kernel that copies parts", [&] { return cudaGetLastError(); });
    copied_.record(stream);
  }

 private:
  PinnedArray<double> found_;
  PinnedArray<char> taken_;
  Event copied_;
};

}  // namespace espalier::device::cuda

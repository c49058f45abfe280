/// \file
/// Where values of a GPU differ from those that it has. For device_linear_system.cu alone.
#pragma once

#include <span>

#include "device/cuda/executor/linear_system_memory.cuh"

namespace espalier::device::cuda {

class DifferingValues {
 public:
  /// Marks rows and columns with entries that differ; on a stream whose device is current, which is done afterwards.
  /// @returns false where there is no memory for that
  template <class T>
  bool mark(LinearSystemMemory<T>& memory, const double* values, std::span<unsigned char> rows,
            std::span<unsigned char> columns, cudaStream_t stream) {
    const auto n = static_cast<Offset>(rows.size());
    try {
      if (marks_.size() == 0)
        marks_ = DeviceArray<unsigned char>(2 * n, memory.budget(), memory.budget().held() + 2 * n);
    } catch (const Error& e) {
      if (e.status().code != StatusCode::out_of_memory) throw;
      return false;
    }
    call("cudaMemsetAsync(marks)",
         [&] { return cudaMemsetAsync(marks_.data(), 0, static_cast<std::size_t>(marks_.bytes()), stream); });
    differ_kernel<<<memory.residual_blocks(false), kSystemThreads, 0, stream>>>(
        memory.pattern(), values, memory.complex() ? 2 : 1, marks_.data(), marks_.data() + n);
    call("launch of the kernel that compares values", [&] { return cudaGetLastError(); });
    const auto fetch = [&](std::span<unsigned char> to, Offset first) {
      call("cudaMemcpyAsync(to host)", [&] {
        return cudaMemcpyAsync(to.data(), marks_.data() + first, to.size(), cudaMemcpyDeviceToHost, stream);
      });
    };
    fetch(rows, 0);
    fetch(columns, n);
    call("cudaStreamSynchronize", [&] { return cudaStreamSynchronize(stream); });
    return true;
  }

 private:
  DeviceArray<unsigned char> marks_;
};

}  // namespace espalier::device::cuda

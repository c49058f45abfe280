/// \file
/// Some entries of vectors between the host and a GPU, sums of vectors, and their largest magnitudes. For
/// device_linear_system.cu alone.
#pragma once

#include <algorithm>
#include <span>
#include <utility>

#include "device/cuda/executor/linear_system_memory.cuh"

namespace espalier::device::cuda {

/// Launches on one stream, whose device is current. The lists lie in pinned memory, which the kernels read.
class VectorEntries {
 public:
  /// Clears the first `cleared` numbers of y, then sets those at `places`.
  void enqueue_scatter(std::span<const Offset> places, std::span<const double> values, double* y, Offset cleared,
                       cudaStream_t stream) {
    if (cleared > 0)
      call("cudaMemsetAsync(vectors)",
           [&] { return cudaMemsetAsync(y, 0, static_cast<std::size_t>(cleared) * sizeof(double), stream); });
    if (places.empty()) return;
    take(places);
    std::copy(values.begin(), values.end(), values_.data());
    const auto count = static_cast<Offset>(places.size());
    set_entries_kernel<<<blocks_for(count), kSystemThreads, 0, stream>>>(count, places_.data(), values_.data(), y);
    call("launch of the kernel that sets entries", [&] { return cudaGetLastError(); });
    read_.record(stream);
  }
  /// What it finds is at found() once the stream is done.
  void enqueue_gather(const double* y, std::span<const Offset> places, cudaStream_t stream) {
    take(places);
    const auto count = static_cast<Offset>(places.size());
    get_entries_kernel<<<blocks_for(count), kSystemThreads, 0, stream>>>(count, places_.data(), y, values_.data());
    call("launch of the kernel that gets entries", [&] { return cudaGetLastError(); });
    read_.record(stream);
  }
  [[nodiscard]] const double* found() const { return values_.data(); }

 private:
  void take(std::span<const Offset> places) {
    read_.wait();  // the launch before has read its lists
    const auto count = static_cast<Offset>(places.size());
    if (places_.size() < count) {
      PinnedArray<Offset> places(count);
      values_ = PinnedArray<double>(count);
      places_ = std::move(places);  // last: its size tells that there are both
    }
    std::copy(places.begin(), places.end(), places_.data());
  }

  PinnedArray<Offset> places_;
  PinnedArray<double> values_;
  Event read_;
};

/// y += sum_k factors[k] z_k.
inline void enqueue_added_columns(Index n, const double* z, std::span<const double> factors, double* y,
                                  cudaStream_t stream) {
  for (std::size_t first = 0; first < factors.size(); first += kAddedColumns) {
    const std::size_t now = std::min<std::size_t>(kAddedColumns, factors.size() - first);
    ColumnFactors some{};
    std::copy_n(factors.data() + first, now, some.of);
    add_columns_kernel<<<blocks_for(n), kSystemThreads, 0, stream>>>(n, z + static_cast<Offset>(first) * n, some,
                                                                     static_cast<int>(now), y);
    call("launch of the kernel that adds columns", [&] { return cudaGetLastError(); });
  }
}

/// The largest magnitude of each vector, at `found` once the stream is done.
/// @param maxima  zeros before and after
/// @param found  pinned
inline void enqueue_largest(Index n, std::span<const double* const> vectors, unsigned long long* maxima, double* found,
                            cudaStream_t stream) {
  static_assert(kLargestVectors <= kResidualNumbers);
  const auto blocks = std::min(blocks_for(n), 256U);
  LargestJob job{n, {}, maxima};
  std::copy(vectors.begin(), vectors.end(), job.of);
  largest_kernel<<<dim3(blocks, static_cast<unsigned>(vectors.size())), kSystemThreads, 0, stream>>>(job);
  call("launch of the kernel of largest magnitudes", [&] { return cudaGetLastError(); });
  call("cudaMemcpyAsync(magnitudes)",
       [&] { return cudaMemcpyAsync(found, job.found, vectors.size_bytes(), cudaMemcpyDeviceToHost, stream); });
  call("cudaMemsetAsync", [&] { return cudaMemsetAsync(job.found, 0, vectors.size_bytes(), stream); });
}

}  // namespace espalier::device::cuda

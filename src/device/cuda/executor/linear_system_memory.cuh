/// \file
/// The arrays of the linear system on a GPU: pattern, permutations, scales, values. For device_linear_system.cu alone.
#pragma once

#include <algorithm>
#include <limits>
#include <span>

#include "base/scalar.hpp"
#include "device/cuda/executor/cuda_executor.hpp"
#include "device/cuda/executor/device_side.hpp"
#include "device/cuda/kernels/complex_system_kernels.cuh"
#include "device/cuda/kernels/linear_system_kernels.cuh"
#include "device/cuda/kernels/residual_kernels.cuh"
#include "device/cuda/kernels/vector_kernels.cuh"
#include "device/cuda/runtime/device_memory.hpp"

namespace espalier::device::cuda {

inline constexpr int kResidualNumbers = kResidualColumns * ResidualSizes::kCount;

inline unsigned blocks_for(Offset threads) {
  return static_cast<unsigned>((threads + kSystemThreads - 1) / kSystemThreads);
}

inline Offset budget_for(int device, Offset memory_bytes) {
  const DeviceGuard guard(device);
  std::size_t free = 0, total = 0;
  call("cudaMemGetInfo", [&] { return cudaMemGetInfo(&free, &total); });
  const auto all = static_cast<Offset>(free);
  return memory_bytes > 0 ? std::min(memory_bytes, all) : all;
}

// Blocks of the kernel that are on the device at a time.
template <class Kernel>
unsigned resident_blocks(Kernel* kernel, int device) {
  int multiprocessors = 0, each = 0;
  call("cudaDeviceGetAttribute",
       [&] { return cudaDeviceGetAttribute(&multiprocessors, cudaDevAttrMultiProcessorCount, device); });
  call("cudaOccupancyMaxActiveBlocksPerMultiprocessor",
       [&] { return cudaOccupancyMaxActiveBlocksPerMultiprocessor(&each, kernel, kSystemThreads, 0); });
  return static_cast<unsigned>(std::max(1, each * multiprocessors));
}

/// Arrays in the order of the executor's stream. Whoever uses them makes the device current.
template <class T>
class LinearSystemMemory {
 public:
  LinearSystemMemory(const LinearSystemArrays& a, CudaExecutor<T>& executor, int device, Offset memory_bytes)
      : executor_(executor),
        device_(device),
        budget_(budget_for(device, memory_bytes)),
        n_(a.pattern.cols),
        nonzeros_(a.pattern.nonzeros()),
        general_(a.pattern.storage == Storage::general),
        complex_(!a.real_columns.empty()),
        system_{nullptr, a.hermitian, a.pattern.storage != Storage::symmetric_upper,
                a.pattern.storage != Storage::symmetric_lower},
        scales_(!a.row_scale.empty() || !a.col_scale.empty()) {
    const DeviceGuard guard(device);
    constexpr Offset kMost = std::numeric_limits<std::uint32_t>::max() - 64;  // kernels look so far ahead
    if (nonzeros_ > kMost) throw Error(StatusCode::out_of_memory, "more than 2^32 entries are not indexed on a device");
    upload(col_ptr_, a.pattern.col_ptr);
    upload(row_ind_, a.pattern.row_ind);
    upload(row_ptr_, a.row_ptr);
    upload(row_col_, a.row_col);
    upload_source(a.row_source);
    upload(order_, a.order);
    upload(row_of_col_, a.row_of_col);
    upload(row_scale_, a.row_scale);
    upload(col_scale_, a.col_scale);
    upload(diagonal_, a.diagonal);
    upload(real_columns_, a.real_columns);
    system_.real_columns = real_columns_.data();
    take_values_memory();
    take_residual_memory();
  }

  [[nodiscard]] DeviceBudget& budget() { return budget_; }
  [[nodiscard]] bool scales() const { return scales_; }
  /// Doubles of all values, of a vector.
  [[nodiscard]] Offset value_doubles() const { return parts() * nonzeros_; }
  [[nodiscard]] Index vector_doubles() const { return parts() * n_; }
  /// Whether the system is complex, and its real form factorized.
  [[nodiscard]] bool complex() const { return complex_; }
  [[nodiscard]] const ComplexSystem& system() const { return system_; }
  // Both halves of most rows fit into a batch of two: more rows at a time then serve better than more entries.
  [[nodiscard]] bool short_rows() const { return nonzeros_ <= 2 * kLanes * Offset{n_}; }
  /// When right-hand sides were gathered, when residuals began; then a ticket.
  [[nodiscard]] unsigned long long* clock() const { return residual_control_.data() + kResidualNumbers; }
  /// Maxima of the residual kernel.
  [[nodiscard]] unsigned long long* maxima() const { return residual_control_.data(); }
  /// By the blocks of the kernel of scalar products.
  [[nodiscard]] double* dot_sums() const { return dot_sums_.data(); }
  /// Blocks of the residual kernel, for one right-hand side and for several.
  [[nodiscard]] unsigned residual_blocks(bool several) const { return residual_blocks_[several ? 1 : 0]; }
  /// By the blocks of the scaling kernel.
  [[nodiscard]] const DeviceArray<double>& largest() const { return largest_; }
  [[nodiscard]] const Offset* diagonal() const { return diagonal_.data(); }

  /// The values as they were given.
  [[nodiscard]] double* given() const {
    if constexpr (base::keeps_fp64<T>)
      if (copy_.size() == 0) return executor_.values();
    return copy_.data();
  }
  /// A place of their own for them; null: the executor has them.
  [[nodiscard]] double* copy() const { return copy_.size() > 0 ? copy_.data() : nullptr; }

  [[nodiscard]] DevicePattern pattern() const {
    return {col_ptr_.data(), row_ind_.data(), row_ptr_.data(), row_col_.data(), row_source_.data(), given(), n_,
            general_};
  }
  [[nodiscard]] Passage passage(Index columns, Index width, bool transpose) const {
    return {order_.data(),
            row_of_col_.data(),
            row_scale_.data(),
            col_scale_.data(),
            vector_doubles(),
            columns,
            width,
            transpose,
            complex_,
            complex_ && !system_.hermitian};
  }
  [[nodiscard]] ValuesJob<T> values_job(const double* values, double* copy) const {
    return {values,
            copy,
            executor_.values(),
            row_scale_.data(),
            col_scale_.data(),
            nonzeros_,
            executor_.values_size(),
            largest_.data()};
  }

 private:
  template <class U>
  DeviceArray<U> take(Offset count) {
    return DeviceArray<U>(count, budget_, budget_.held() + count * static_cast<Offset>(sizeof(U)));
  }
  template <class U>
  void upload(DeviceArray<U>& to, std::span<const U> from) {
    to = take<U>(static_cast<Offset>(from.size()));
    executor_.uploads().copy(to.data(), from.data(), to.bytes(), stream());
  }
  // In 32 bits: half the memory and half the traffic of every residual.
  void upload_source(std::span<const Offset> source) {
    row_source_ = take<std::uint32_t>(static_cast<Offset>(source.size()));
    executor_.uploads().make(row_source_.data(), row_source_.size(), sizeof(std::uint32_t), stream(),
                             [source](std::byte* stage, Offset first, Offset end) {
                               auto* to = reinterpret_cast<std::uint32_t*>(stage);
                               for (Offset k = first; k < end; ++k)
                                 *to++ = static_cast<std::uint32_t>(source[static_cast<std::size_t>(k)]);
                             });
  }

  // FP64 values that nothing scales are factored as they are; all others need a place of their own, and those that
  // other ranks read.
  void take_values_memory() {
    if (executor_.on_ranks())
      copy_ = take<double>(whole_pages<double>(value_doubles()));
    else if (!base::keeps_fp64<T> || scales_ || complex_ || executor_.values_size() < nonzeros_)
      copy_ = take<double>(value_doubles());
    const unsigned most = complex_  ? resident_blocks(scale_complex_kernel<T>, device_)
                          : scales_ ? resident_blocks(scale_kernel<T>, device_)
                                    : resident_blocks(take_kernel<T>, device_);
    const Offset threads = scales_ || complex_ ? static_cast<Offset>(n_) * kLanes : nonzeros_;
    largest_ = take<double>(std::clamp<Offset>(blocks_for(threads), 1, most));
  }
  void take_residual_memory() {
    const unsigned rows = blocks_for(static_cast<Offset>(n_) * kLanes);
    const auto blocks = [&](auto* kernel) { return std::clamp(resident_blocks(kernel, device_), 1U, rows); };
    if (complex_)
      residual_blocks_[0] = blocks(complex_residual_kernel);
    else
      residual_blocks_[0] = blocks(short_rows() ? residual_kernel<1, 2> : residual_kernel<1, 4>);
    residual_blocks_[1] = blocks(residual_kernel<kResidualColumns, 1>);
    dot_sums_ = take<double>(dot_blocks(vector_doubles()));
    residual_control_ = take<unsigned long long>(kResidualNumbers + 3);
    call("cudaMemset",
         [&] { return cudaMemset(residual_control_.data(), 0, static_cast<std::size_t>(residual_control_.bytes())); });
  }

  [[nodiscard]] Index parts() const { return complex_ ? 2 : 1; }
  cudaStream_t stream() const { return static_cast<cudaStream_t>(executor_.stream()); }

  CudaExecutor<T>& executor_;
  int device_;
  DeviceBudget budget_;
  Index n_;
  Offset nonzeros_;
  bool general_, complex_;
  ComplexSystem system_;
  bool scales_;
  DeviceArray<Offset> col_ptr_, row_ptr_, diagonal_, real_columns_;
  DeviceArray<Index> row_ind_, row_col_, order_, row_of_col_;
  DeviceArray<std::uint32_t> row_source_;
  DeviceArray<double> row_scale_, col_scale_;
  DeviceArray<double> copy_;     // values as they were given; empty: the executor has them
  DeviceArray<double> largest_;  // of the blocks of the scaling kernel
  DeviceArray<double> dot_sums_;
  DeviceArray<unsigned long long> residual_control_;
  unsigned residual_blocks_[2] = {};  // for one right-hand side, for several
};

}  // namespace espalier::device::cuda

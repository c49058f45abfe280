/// \file
/// Kernels over the linear system on the device: values copied and scaled, right-hand sides permuted.
#pragma once

#include "device/cuda/kernels/block_sums.cuh"
#include "device/cuda/kernels/device_pattern.cuh"

namespace espalier::device::cuda {

/// New values on their way to the factorization: scaled(q) = r_i a_ij c_j for the first `factored` entries, a copy of
/// all as they are, and the largest magnitude of each block of threads (infinity: not finite).
template <class T>
struct ValuesJob {
  const double* values;
  double* copy;  ///< null: `values` is the copy, or `scaled` is
  T* scaled;
  const double* row_scale;  ///< n; null: ones
  const double* col_scale;
  Offset nonzeros;
  Offset factored;
  double* largest;  ///< blocks of the grid
};

constexpr int kAtOnce = 4;  ///< entries that a thread loads before it stores the first

/// Without scales: entries in their order. scaled may be `values`.
template <class T>
__global__ void __launch_bounds__(kSystemThreads) take_kernel(const ValuesJob<T> job) {
  const Offset step = static_cast<Offset>(gridDim.x) * kSystemThreads;
  double most = 0;
  for (Offset first = static_cast<Offset>(blockIdx.x) * kSystemThreads + threadIdx.x; first < job.nonzeros;
       first += kAtOnce * step) {
    double v[kAtOnce];
#pragma unroll
    for (int k = 0; k < kAtOnce; ++k) v[k] = first + k * step < job.nonzeros ? job.values[first + k * step] : 0;
#pragma unroll
    for (int k = 0; k < kAtOnce; ++k) {
      const Offset q = first + k * step;
      const T scaled = static_cast<T>(v[k]);
      if (job.copy != nullptr && q < job.nonzeros) job.copy[q] = v[k];
      if (q < job.factored) job.scaled[q] = scaled;
      most = larger(most, fabs(static_cast<double>(scaled)));
    }
  }
  most = largest_of_block(most);
  if (threadIdx.x == 0) job.largest[blockIdx.x] = most;
}

/// With scales: a column for each group of lanes.
template <class T>
__global__ void __launch_bounds__(kSystemThreads) scale_kernel(DevicePattern p, const ValuesJob<T> job) {
  const int lane = static_cast<int>(threadIdx.x) % kLanes;
  const Offset step = static_cast<Offset>(gridDim.x) * kRowsOfBlock;
  double most = 0;
  for (Offset col = static_cast<Offset>(blockIdx.x) * kRowsOfBlock + threadIdx.x / kLanes; col < p.n; col += step) {
    const double c = job.col_scale != nullptr ? job.col_scale[col] : 1.0;
    const Offset end = p.col_ptr[col + 1];
    for (Offset first = p.col_ptr[col] + lane; first < end; first += kAtOnce * kLanes) {
      double v[kAtOnce], r[kAtOnce];
#pragma unroll
      for (int k = 0; k < kAtOnce; ++k) {
        const Offset q = first + k * kLanes;
        v[k] = q < end ? job.values[q] : 0;
        r[k] = q < end && job.row_scale != nullptr ? job.row_scale[p.row_ind[q]] : 1.0;
      }
#pragma unroll
      for (int k = 0; k < kAtOnce; ++k) {
        const Offset q = first + k * kLanes;
        const T scaled = static_cast<T>(v[k] * c * r[k]);
        if (q < end && job.copy != nullptr) job.copy[q] = v[k];
        if (q < end && q < job.factored) job.scaled[q] = scaled;
        most = larger(most, fabs(static_cast<double>(scaled)));
      }
    }
  }
  most = largest_of_block(most);
  if (threadIdx.x == 0) job.largest[blockIdx.x] = most;
}

/// Marks rows and columns of entries, of `parts` doubles each, in which `values` differ from DevicePattern::values bit
/// by bit.
__global__ void __launch_bounds__(kSystemThreads)
    differ_kernel(DevicePattern p, const double* values, int parts, unsigned char* rows, unsigned char* columns) {
  const int lane = static_cast<int>(threadIdx.x) % kLanes;
  const Offset step = static_cast<Offset>(gridDim.x) * kRowsOfBlock;
  for (Offset col = static_cast<Offset>(blockIdx.x) * kRowsOfBlock + threadIdx.x / kLanes; col < p.n; col += step)
    for (Offset q = p.col_ptr[col] + lane; q < p.col_ptr[col + 1]; q += kLanes) {
      bool same = true;
      for (Offset k = parts * q; k < parts * (q + 1); ++k)
        same = same && __double_as_longlong(values[k]) == __double_as_longlong(p.values[k]);
      if (!same) rows[p.row_ind[q]] = columns[col] = 1;
    }
}

/// How right-hand sides are permuted and scaled on their way to the factor and back; null: identity, ones.
struct Passage {
  const Index* order;
  const Index* row_of_col;
  const double* row_scale;
  const double* col_scale;
  Index n, columns, width;  ///< n: positions; doubles of a vector
  bool transpose;
  bool pairs;  ///< positions and vectors are those of the real form of a complex system; all else is the complex one
  bool conjugate;  ///< of such a system: imaginary parts change their signs on the way in

  /// The equation (on the way in) or unknown (on the way out) at position k, or that of which it is a part.
  __device__ Index place(Index k, bool out) const {
    const Index col = pairs ? order[k] >> 1 : order[k];
    return (transpose == out && row_of_col != nullptr) ? row_of_col[col] : col;
  }
  /// Where it stands in a vector.
  __device__ Offset number(Index k, Index i) const { return pairs ? 2 * static_cast<Offset>(i) + (order[k] & 1) : i; }
  __device__ double sign(Index k) const { return conjugate && (order[k] & 1) != 0 ? -1 : 1; }
  __device__ double scale(Index i, bool out) const {
    const double* s = transpose == out ? row_scale : col_scale;
    return s != nullptr ? s[i] : 1.0;
  }
};

/// rhs (n x width, row-major, by position) = scaled b; columns beyond the last are zero. *clock: when it began. What
/// the executor wants cleared is cleared on the way.
template <class T>
__global__ void gather_kernel(Passage p, const double* b, T* rhs, SolveClear clear, unsigned long long* clock) {
  if (blockIdx.x == 0 && threadIdx.x == 0) *clock = nanoseconds_now();
  if (blockIdx.x == 0 && threadIdx.x < clear.zeros_count) clear.zeros[threadIdx.x] = 0;
  const Offset step = static_cast<Offset>(gridDim.x) * kSystemThreads;
  for (Offset k = static_cast<Offset>(blockIdx.x) * kSystemThreads + threadIdx.x; k < clear.ones_count; k += step)
    clear.ones[k] = -1;
  const Offset at = static_cast<Offset>(blockIdx.x) * kSystemThreads + threadIdx.x;
  if (at >= static_cast<Offset>(p.n) * p.width) return;
  const auto k = static_cast<Index>(at / p.width), c = static_cast<Index>(at % p.width);
  const Index i = p.place(k, false);
  rhs[at] = c < p.columns
                ? static_cast<T>(p.sign(k) * p.scale(i, false) * b[static_cast<Offset>(c) * p.n + p.number(k, i)])
                : T(0);
}

/// x = scaled rhs.
template <class T>
__global__ void scatter_kernel(Passage p, const T* rhs, double* x) {
  const Offset at = static_cast<Offset>(blockIdx.x) * kSystemThreads + threadIdx.x;
  if (at >= static_cast<Offset>(p.n) * p.width) return;
  const auto k = static_cast<Index>(at / p.width), c = static_cast<Index>(at % p.width);
  if (c >= p.columns) return;
  const Index i = p.place(k, true);
  x[static_cast<Offset>(c) * p.n + p.number(k, i)] = p.scale(i, true) * static_cast<double>(rhs[at]);
}

}  // namespace espalier::device::cuda

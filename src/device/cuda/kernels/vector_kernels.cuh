/// \file
/// Vectors on the device: sums, linear combinations and scalar products. Blocks of kSystemThreads.
#pragma once

#include "device/cuda/kernels/block_sums.cuh"
#include "device/cuda/kernels/device_pattern.cuh"

namespace espalier::device::cuda {

/// to += from.
__global__ void add_kernel(Index n, const double* from, double* to) {
  const Offset i = static_cast<Offset>(blockIdx.x) * kSystemThreads + threadIdx.x;
  if (i < n) to[i] += from[i];
}

/// y = a x + b y; y is not read where b is zero.
__global__ void combine_kernel(Index n, double a, const double* x, double b, double* y) {
  const Offset i = static_cast<Offset>(blockIdx.x) * kSystemThreads + threadIdx.x;
  if (i < n) y[i] = b == 0 ? a * x[i] : a * x[i] + b * y[i];
}

constexpr int kAddedColumns = 32;  ///< in one pass

struct ColumnFactors {
  double of[kAddedColumns];
};

/// y += sum_k factors.of[k] z_k, in the order of k; vectors of n numbers, one after another.
__global__ void __launch_bounds__(kSystemThreads)
    add_columns_kernel(Index n, const double* z, const ColumnFactors factors, int columns, double* y) {
  const Offset i = static_cast<Offset>(blockIdx.x) * kSystemThreads + threadIdx.x;
  if (i >= n) return;
  double sum = y[i];
#pragma unroll 8
  for (int k = 0; k < columns; ++k) sum += factors.of[k] * z[static_cast<Offset>(k) * n + i];
  y[i] = sum;
}

/// y[places[k]] = values[k].
__global__ void set_entries_kernel(Offset count, const Offset* places, const double* values, double* y) {
  const Offset k = static_cast<Offset>(blockIdx.x) * kSystemThreads + threadIdx.x;
  if (k < count) y[places[k]] = values[k];
}

/// values[k] = y[places[k]].
__global__ void get_entries_kernel(Offset count, const Offset* places, const double* y, double* values) {
  const Offset k = static_cast<Offset>(blockIdx.x) * kSystemThreads + threadIdx.x;
  if (k < count) values[k] = y[places[k]];
}

constexpr int kLargestVectors = 32;  ///< in one pass

struct LargestJob {
  Index n;
  const double* of[kLargestVectors];
  unsigned long long* found;  ///< zero before; the bits of magnitudes rise with them, and those of NaN are above all
};

/// The largest magnitude of vector blockIdx.y.
__global__ void __launch_bounds__(kSystemThreads) largest_kernel(const LargestJob job) {
  const double* x = job.of[blockIdx.y];
  unsigned long long most = 0;
  const Offset step = static_cast<Offset>(gridDim.x) * kSystemThreads;
  for (Offset i = static_cast<Offset>(blockIdx.x) * kSystemThreads + threadIdx.x; i < job.n; i += step) {
    const auto bits = static_cast<unsigned long long>(__double_as_longlong(fabs(x[i])));
    most = bits > most ? bits : most;
  }
  for (int d = 16; d > 0; d /= 2) {
    const unsigned long long other = __shfl_xor_sync(0xffffffffu, most, d);
    most = other > most ? other : most;
  }
  if (threadIdx.x % 32 == 0 && most != 0) atomicMax(job.found + blockIdx.y, most);
}

/// What the host reads after a scalar product: pinned memory that the GPU writes.
struct DotEnd {
  double sum;
  int aborted;  ///< nonzero: the substitution before it was given up
};

struct DotJob {
  Index n;
  const double* a;
  const double* b;
  double* sums;        ///< of the blocks
  int* ticket;         ///< zero, before and after
  const int* aborted;  ///< null: nothing to report
  DotEnd* end;
};

constexpr Index kDotValues = 16 * kSystemThreads;  ///< of a block

/// Blocks of dot_kernel(): by n alone, so that the sums always have the same order.
inline unsigned dot_blocks(Index n) {
  return static_cast<unsigned>(n > 0 ? (static_cast<Offset>(n) + kDotValues - 1) / kDotValues : 1);
}

/// Sum over the block, in a fixed order, for thread 0 alone.
__device__ inline double sum_of_block(double x) {
  __shared__ double warps[kSystemThreads / 32];
  const auto over_lanes = [&](int width) {
    for (int d = 1; d < width; d *= 2) x += __shfl_xor_sync(0xffffffffu, x, d);
  };
  over_lanes(32);
  if (threadIdx.x % 32 == 0) warps[threadIdx.x / 32] = x;
  __syncthreads();
  if (threadIdx.x < 32) {
    x = threadIdx.x < kSystemThreads / 32 ? warps[threadIdx.x] : 0;
    over_lanes(kSystemThreads / 32);
  }
  __syncthreads();
  return x;
}

__global__ void __launch_bounds__(kSystemThreads) dot_kernel(const DotJob job) {
  double sum = 0;
  const Offset first = static_cast<Offset>(blockIdx.x) * kDotValues;
  for (int k = 0; k < kDotValues / kSystemThreads; ++k) {
    const Offset i = first + k * kSystemThreads + static_cast<Offset>(threadIdx.x);
    if (i < job.n) sum += job.a[i] * job.b[i];
  }
  sum = sum_of_block(sum);
  if (threadIdx.x == 0) job.sums[blockIdx.x] = sum;
  if (!last_block(job.ticket)) return;
  sum = 0;
  for (unsigned k = threadIdx.x; k < gridDim.x; k += kSystemThreads) sum += __ldcg(job.sums + k);
  sum = sum_of_block(sum);
  if (threadIdx.x == 0) *job.end = {sum, job.aborted != nullptr ? *job.aborted : 0};
}

}  // namespace espalier::device::cuda

/// \file
/// Tall blocks, column-major: products with small matrices, their Gram matrices, and a sparse matrix times eight
/// columns.
#pragma once

#include <cstdint>

#include "espalier/types.hpp"

namespace espalier::device::cuda {

constexpr int kTallThreads = 256;
constexpr int kTallColumns = 8;  ///< of the right factor, in one pass
constexpr int kTallRows = 512;   ///< of one block of threads in gram_kernel()

/// Sum over the lanes of a warp, in a fixed order.
__device__ inline double sum_of_warp(double x) {
  for (int d = 16; d > 0; d /= 2) x += __shfl_xor_sync(0xffffffffu, x, d);
  return x;
}

/// Part of V^T W over the rows of this block: parts[(block * p + i) * kTallColumns + j]. @param b  at most kTallColumns
__global__ void __launch_bounds__(kTallThreads)
    gram_kernel(Offset n, const double* v, int p, const double* w, int b, double* parts) {
  __shared__ double block[kTallColumns][kTallRows];
  const Offset begin = static_cast<Offset>(blockIdx.x) * kTallRows;
  for (int k = static_cast<int>(threadIdx.x); k < kTallColumns * kTallRows; k += kTallThreads) {
    const int j = k / kTallRows, r = k % kTallRows;
    block[j][r] = j < b && begin + r < n ? w[j * n + begin + r] : 0;
  }
  __syncthreads();
  const int lane = static_cast<int>(threadIdx.x) % 32;
  for (int i = static_cast<int>(threadIdx.x) / 32; i < p; i += kTallThreads / 32) {
    double sum[kTallColumns] = {};
#pragma unroll 4
    for (int r = lane; r < kTallRows; r += 32) {
      const double a = begin + r < n ? v[i * n + begin + r] : 0;
#pragma unroll
      for (int j = 0; j < kTallColumns; ++j) sum[j] += a * block[j][r];
    }
#pragma unroll
    for (int j = 0; j < kTallColumns; ++j) {
      const double s = sum_of_warp(sum[j]);
      if (lane == 0) parts[(static_cast<Offset>(blockIdx.x) * p + i) * kTallColumns + j] = s;
    }
  }
}

/// The same of d: parts[block * kTallColumns + j] of sum_i d_i w_ij^2.
__global__ void __launch_bounds__(kTallThreads)
    squares_kernel(Offset n, const double* d, const double* w, int b, double* parts) {
  const Offset begin = static_cast<Offset>(blockIdx.x) * kTallRows;
  const int lane = static_cast<int>(threadIdx.x) % 32, j = static_cast<int>(threadIdx.x) / 32;
  double sum = 0;
  for (int r = lane; r < kTallRows && j < b; r += 32)
    if (begin + r < n) sum += d[begin + r] * w[j * n + begin + r] * w[j * n + begin + r];
  sum = sum_of_warp(sum);
  if (lane == 0) parts[static_cast<Offset>(blockIdx.x) * kTallColumns + j] = sum;
}

/// sums[k] = sum of parts[i * size + k] over i < count, in their order by runs of 32.
__global__ void __launch_bounds__(kTallThreads)
    add_parts_kernel(const double* parts, Offset count, int size, double* sums) {
  const int k = static_cast<int>((blockIdx.x * kTallThreads + threadIdx.x) / 32);
  if (k >= size) return;
  const int lane = static_cast<int>(threadIdx.x) % 32;
  double sum = 0;
  for (Offset i = lane; i < count; i += 32) sum += parts[i * size + k];
  sum = sum_of_warp(sum);
  if (lane == 0) sums[k] = sum;
}

/// W -= V H (kSubtract), or out = V S. @param small  p x kTallColumns, row-major, padded with zeros
template <bool kSubtract>
__global__ void __launch_bounds__(kTallThreads)
    times_small_kernel(Offset n, Offset stride, const double* v, int p, const double* small, int b, Offset out_stride,
                       double* out) {
  extern __shared__ double matrix[];
  for (int k = static_cast<int>(threadIdx.x); k < p * kTallColumns; k += kTallThreads) matrix[k] = small[k];
  __syncthreads();
  const Offset row = static_cast<Offset>(blockIdx.x) * kTallThreads + threadIdx.x;
  if (row >= n) return;
  double sum[kTallColumns] = {};
#pragma unroll 4
  for (int i = 0; i < p; ++i) {
    const double a = v[i * stride + row];
#pragma unroll
    for (int j = 0; j < kTallColumns; ++j) sum[j] += a * matrix[i * kTallColumns + j];
  }
  for (int j = 0; j < b; ++j) {
    double& to = out[j * out_stride + row];
    to = kSubtract ? to - sum[j] : sum[j];
  }
}

/// packed = `b` columns of x, row-major, padded with zeros.
__global__ void __launch_bounds__(kTallThreads) pack_columns_kernel(Offset n, const double* x, int b, double* packed) {
  const Offset k = static_cast<Offset>(blockIdx.x) * kTallThreads + threadIdx.x;
  if (k >= n * kTallColumns) return;
  const int j = static_cast<int>(k % kTallColumns);
  packed[k] = j < b ? x[j * n + k / kTallColumns] : 0;
}

/// y = A x of packed columns: a row for each warp, four entries at a time, a column for each lane.
__global__ void __launch_bounds__(kTallThreads)
    sparse_times_kernel(Offset n, const Offset* first, const Index* column, const double* value, const double* packed,
                        int b, double* y) {
  const Offset row = (static_cast<Offset>(blockIdx.x) * kTallThreads + threadIdx.x) / 32;
  if (row >= n) return;
  const int lane = static_cast<int>(threadIdx.x) % 32, j = lane % kTallColumns;
  double sum = 0;
  for (Offset k = first[row] + lane / kTallColumns; k < first[row + 1]; k += 32 / kTallColumns)
    sum += value[k] * packed[static_cast<Offset>(column[k]) * kTallColumns + j];
  sum += __shfl_xor_sync(0xffffffffu, sum, 8);
  sum += __shfl_xor_sync(0xffffffffu, sum, 16);
  if (lane < b) y[j * n + row] = sum;
}

}  // namespace espalier::device::cuda

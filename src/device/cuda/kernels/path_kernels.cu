#include <algorithm>

#include "device/cuda/kernels/path_kernels.hpp"

namespace espalier::device::cuda {

namespace {

constexpr int kPathThreads = 256;
constexpr int kSlices = 8;  // blocks that share a front
constexpr Offset kMostBlocks = 2048;

__device__ inline void missing(double& v) { v = __longlong_as_double(-1LL); }
__device__ inline void missing(float& v) { v = __int_as_float(-1); }

/// Rows of `width` values from `row` on.
template <class T>
__device__ void fill(T* vector, std::int64_t row, std::int64_t rows, int width, T value) {
  T* const to = vector + row * width;
  for (std::int64_t k = static_cast<std::int64_t>(blockIdx.x % kSlices) * kPathThreads + threadIdx.x; k < rows * width;
       k += kSlices * kPathThreads)
    to[k] = value;
}

template <class T>
__global__ void __launch_bounds__(kPathThreads) begin_kernel(PathBegin<T> job) {
  if (blockIdx.x == 0)
    for (int k = static_cast<int>(threadIdx.x); k < job.control_size; k += kPathThreads) job.control[k] = 0;
  const std::int32_t number = job.passed[blockIdx.x / kSlices];
  const Front& f = job.fronts[number];
  const unsigned char mark = job.marks[number];
  T ones;
  missing(ones);
  if ((mark & kPathUp) != 0) {
    fill(job.forward, f.position, f.pivots, job.pass, ones);
    fill(job.updates, f.rows, f.below, job.pass, ones);
    if (job.rhs != nullptr) fill(job.rhs, f.position, f.pivots, job.columns, T(0));
  }
  if ((mark & kPathDown) != 0) fill(job.solution, f.position, f.pivots, job.pass, ones);
}

template <class T>
__global__ void __launch_bounds__(kPathThreads) row_kernel(RowCopy<T> job) {
  const Offset step = static_cast<Offset>(gridDim.x) * kPathThreads;
  for (Offset k = static_cast<Offset>(blockIdx.x) * kPathThreads + threadIdx.x; k < job.count * job.columns;
       k += step) {
    const Offset row = k / job.columns, c = k % job.columns;
    const Offset to = job.to_rows != nullptr ? job.to_rows[row] : row;
    const Offset from = job.from_rows != nullptr ? job.from_rows[row] : row;
    job.to[to * job.columns + c] = job.from[from * job.columns + c];
  }
}

}  // namespace

template <class T>
cudaError_t launch_path_begin(const PathBegin<T>& job, cudaStream_t stream) {
  if (job.count > 0) begin_kernel<<<static_cast<unsigned>(job.count) * kSlices, kPathThreads, 0, stream>>>(job);
  return cudaGetLastError();
}

template <class T>
cudaError_t launch_row_copy(const RowCopy<T>& job, cudaStream_t stream) {
  const Offset blocks = std::min((job.count * job.columns + kPathThreads - 1) / kPathThreads, kMostBlocks);
  if (blocks > 0) row_kernel<<<static_cast<unsigned>(blocks), kPathThreads, 0, stream>>>(job);
  return cudaGetLastError();
}

template cudaError_t launch_path_begin<double>(const PathBegin<double>&, cudaStream_t);
template cudaError_t launch_path_begin<float>(const PathBegin<float>&, cudaStream_t);
template cudaError_t launch_row_copy<double>(const RowCopy<double>&, cudaStream_t);
template cudaError_t launch_row_copy<float>(const RowCopy<float>&, cudaStream_t);

}  // namespace espalier::device::cuda

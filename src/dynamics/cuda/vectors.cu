#include <algorithm>

#include "dynamics/cuda/vectors.hpp"

namespace espalier::dynamics::cuda {

namespace {

constexpr int kThreads = 256;

__device__ Offset this_thread() { return static_cast<Offset>(blockIdx.x) * blockDim.x + threadIdx.x; }

// x_i := s_i x_i for all columns.
__global__ void scale_kernel(Offset size, Offset count, const double* scale, double* x) {
  const Offset k = this_thread();
  if (k < size * count) x[k] *= scale[k % size];
}

// One s_r in each column, which is zero so far.
__global__ void unit_kernel(Offset size, Offset count, const Index* rows, const double* scale, double* columns) {
  const Offset c = this_thread();
  if (c < count) columns[c * size + rows[c]] = scale[rows[c]];
}

// One thread per row, in the order of the columns.
__global__ void combine_kernel(Offset size, Offset count, const double* columns, const double* factors, double* x) {
  const Offset i = this_thread();
  if (i >= size) return;
  double sum = 0;
  for (Offset c = 0; c < count; ++c) sum += factors[c] * columns[c * size + i];
  x[i] = sum;
}

}  // namespace

double* CudaVectors::room_for(DeviceArray<double>& array, Offset numbers) {
  if (array.size() < numbers) {
    gpu_.budget.give_back(array.bytes());
    array = DeviceArray<double>();
    array = make_array<double>(numbers, gpu_);
  }
  return array.data();
}

void CudaVectors::scale_columns(double* columns, Offset count) {
  scale_kernel<<<blocks_for(size_ * count, kThreads), kThreads, 0, gpu_.stream.get()>>>(size_, count, scale_, columns);
  call("launch of the scaling of right-hand sides", [&] { return cudaGetLastError(); });
}

void CudaVectors::solve(Span b, const Solve& solve) {
  const DeviceGuard guard(gpu_.number);
  const Offset count = static_cast<Offset>(b.size()) / size_;
  double* const at = room_for(work_, count * size_);
  gpu_.send(b, at);
  scale_columns(at, count);
  solve(at, static_cast<Index>(count));
  scale_columns(at, count);
  gpu_.fetch(at, b);
}

void CudaVectors::solve_there(double* b, const Solve& solve) {
  const DeviceGuard guard(gpu_.number);
  scale_columns(b, 1);
  solve(b, 1);
  scale_columns(b, 1);
}

void CudaVectors::put_lower(ConstSpan r, double* b) {
  const DeviceGuard guard(gpu_.number);
  const auto lower = static_cast<Offset>(r.size()), upper = size_ - lower;
  call("cudaMemsetAsync(right-hand side)",
       [&] { return cudaMemsetAsync(b, 0, static_cast<std::size_t>(upper) * sizeof(double), gpu_.stream.get()); });
  gpu_.send(r, b + upper);
}

void CudaVectors::make_columns(std::span<const Index> rows, const Solve& solve) {
  const DeviceGuard guard(gpu_.number);
  kept_ = 0;
  const auto count = static_cast<Offset>(rows.size());
  if (count == 0) return;
  double* const columns = room_for(columns_, count * size_);
  gpu_.budget.give_back(rows_.bytes());
  rows_ = upload(rows, gpu_);
  const cudaStream_t stream = gpu_.stream.get();
  call("cudaMemsetAsync(columns)",
       [&] { return cudaMemsetAsync(columns, 0, static_cast<std::size_t>(count * size_) * sizeof(double), stream); });
  unit_kernel<<<blocks_for(count, kThreads), kThreads, 0, stream>>>(size_, count, rows_.data(), scale_, columns);
  call("launch of the unit vectors", [&] { return cudaGetLastError(); });
  for (Offset first = 0; first < count; first += kMostColumns)
    solve(columns + first * size_, static_cast<Index>(std::min<Offset>(kMostColumns, count - first)));
  scale_columns(columns, count);
  kept_ = count;
}

void CudaVectors::combine_columns(ConstSpan factors, Span x) {
  const DeviceGuard guard(gpu_.number);
  double* const sum = room_for(work_, size_);
  combine_columns_there(factors, sum);
  gpu_.fetch(sum, x);
}

void CudaVectors::combine_columns_there(ConstSpan factors, double* x) {
  const DeviceGuard guard(gpu_.number);
  double* const to = room_for(factors_, kept_);
  gpu_.send(factors, to);
  combine_kernel<<<blocks_for(size_, kThreads), kThreads, 0, gpu_.stream.get()>>>(size_, kept_, columns_.data(), to, x);
  call("launch of the sum of columns", [&] { return cudaGetLastError(); });
}

void CudaVectors::fetch_columns(Span to) {
  const DeviceGuard guard(gpu_.number);
  gpu_.fetch(columns_.data(), to.first(static_cast<std::size_t>(kept_ * size_)));
}

}  // namespace espalier::dynamics::cuda

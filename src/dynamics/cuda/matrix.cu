#include <algorithm>

#include "dynamics/cuda/matrix.hpp"
#include "dynamics/cuda/vectors.hpp"

namespace espalier::dynamics::cuda {

namespace {

constexpr int kThreads = 256, kWarp = 32;

__global__ void add_kernel(Offset count, const Offset* place, const double* from, double* values) {
  const Offset k = static_cast<Offset>(blockIdx.x) * blockDim.x + threadIdx.x;
  if (k < count) values[place[k]] += from[k];
}

__global__ void set_kernel(Offset count, const Offset* place, const double* from, double* values) {
  const Offset k = static_cast<Offset>(blockIdx.x) * blockDim.x + threadIdx.x;
  if (k < count) values[place[k]] = from[k];
}

struct Columns {
  Offset count;
  const Offset *w_ptr, *k_ptr;
  const Index* w_ind;
};

// One warp per column of W.
__global__ void sizes_kernel(Columns c, const double* values, double* diagonal, double* largest) {
  const Offset j = (static_cast<Offset>(blockIdx.x) * blockDim.x + threadIdx.x) / kWarp;
  if (j >= c.count) return;
  double most = 0, own = 0;
  for (Offset p = c.w_ptr[j] + threadIdx.x % kWarp; p < c.w_ptr[j + 1]; p += kWarp) {
    const double v = fabs(values[c.k_ptr[j] + p - c.w_ptr[j]]);
    if (most == most && !(v <= most)) most = v;  // a NaN gets through
    if (c.w_ind[p] == j) own = v;
  }
  for (int step = kWarp / 2; step > 0; step /= 2) {
    const double other = __shfl_xor_sync(0xffffffffU, most, step);
    if (most == most && !(other <= most)) most = other;
    own += __shfl_xor_sync(0xffffffffU, own, step);
  }
  if (threadIdx.x % kWarp != 0) return;
  diagonal[j] = own;
  largest[j] = most;
}

__global__ void scale_kernel(Columns c, const double* scale, double* values) {
  const Offset j = (static_cast<Offset>(blockIdx.x) * blockDim.x + threadIdx.x) / kWarp;
  if (j >= c.count) return;
  for (Offset p = c.w_ptr[j] + threadIdx.x % kWarp; p < c.w_ptr[j + 1]; p += kWarp) {
    double& v = values[c.k_ptr[j] + p - c.w_ptr[j]];
    v = v * scale[c.w_ind[p]] * scale[j];
  }
}

// One warp per column of W, the first of which is column `first`. @param to  the values of these columns alone
__global__ void unscale_kernel(Columns c, Offset first, const double* scale, const double* values, double* to) {
  const Offset j = (static_cast<Offset>(blockIdx.x) * blockDim.x + threadIdx.x) / kWarp;
  if (j >= c.count) return;
  for (Offset p = c.w_ptr[j] + threadIdx.x % kWarp; p < c.w_ptr[j + 1]; p += kWarp)
    to[p - c.w_ptr[0]] = values[c.k_ptr[j] + p - c.w_ptr[j]] / scale[first + j] / scale[c.w_ind[p]];
}

using Bits = unsigned long long;

// term(i, |W_ij| x_j) of all entries; one warp per column of W.
template <class Term>
__device__ void for_terms_of_rows(const Columns& c, const double* scale, const double* values, const double* x,
                                  const Term& term) {
  const Offset j = (static_cast<Offset>(blockIdx.x) * blockDim.x + threadIdx.x) / kWarp;
  if (j >= c.count) return;
  for (Offset p = c.w_ptr[j] + threadIdx.x % kWarp; p < c.w_ptr[j + 1]; p += kWarp) {
    const Index i = c.w_ind[p];
    term(i, fabs(values[c.k_ptr[j] + p - c.w_ptr[j]] / scale[j] / scale[i]) * x[j]);
  }
}

// Sums whose order the hardware chooses are made of whole numbers: parts of the largest term of a row. Bits of numbers
// without their sign rise with the numbers, a NaN above all.
constexpr double kUnit = 1LL << 40;

__global__ void largest_terms_kernel(Columns c, const double* scale, const double* values, const double* x,
                                     Bits* largest) {
  for_terms_of_rows(c, scale, values, x, [&](Index i, double term) {
    atomicMax(largest + i, static_cast<Bits>(__double_as_longlong(term)));
  });
}

__global__ void sum_terms_kernel(Columns c, const double* scale, const double* values, const double* x,
                                 const Bits* largest, Bits* sums) {
  for_terms_of_rows(c, scale, values, x, [&](Index i, double term) {
    const double most = __longlong_as_double(static_cast<long long>(largest[i]));
    if (most > 0) atomicAdd(sums + i, static_cast<Bits>(__double2ll_rn(term / most * kUnit)));
  });
}

// @param largest  gets the sums
__global__ void rows_kernel(Offset rows, const Bits* sums, double* largest) {
  const Offset i = static_cast<Offset>(blockIdx.x) * blockDim.x + threadIdx.x;
  if (i < rows) largest[i] *= static_cast<double>(sums[i]) / kUnit;
}

}  // namespace

CudaMatrix::CudaMatrix(const DeviceMatrixLayout& layout, Gpu& gpu)
    : gpu_(gpu),
      columns_(layout.w->cols),
      size_(layout.k_ptr.back()),
      unknowns_(static_cast<Offset>(layout.k_ptr.size()) - 1) {
  const DeviceGuard guard(gpu_.number);
  k_ptr_ = upload(layout.k_ptr, gpu_);
  w_ptr_ = upload<Offset>(layout.w->ptr, gpu_);
  w_ind_ = upload<Index>(layout.w->ind, gpu_);
  w_of_host_ = upload(layout.w_of_host, gpu_);
  rest_ = upload(layout.rest, gpu_);
  values_ = make_array<double>(size_, gpu_);
  sizes_ = make_array<double>(2 * columns_, gpu_);
  scale_ = make_array<double>(unknowns_, gpu_);
  // Longer than any column of W, too.
  room_ = std::max({w_of_host_.size(), rest_.size(), unknowns_});
  from_host_ = make_array<double>(room_, gpu_);
}

double* CudaMatrix::clear() {
  const DeviceGuard guard(gpu_.number);
  call("cudaMemsetAsync", [&] {
    return cudaMemsetAsync(values_.data(), 0, static_cast<std::size_t>(values_.bytes()), gpu_.stream.get());
  });
  return values_.data();
}

void CudaMatrix::add_from_host(const Fill& fill) {
  const Offset count = w_of_host_.size();
  if (count == 0) return;
  const DeviceGuard guard(gpu_.number);
  gpu_.link.send_made(from_host_.data(), count, gpu_.stream.get(), fill);
  add_kernel<<<blocks_for(count, kThreads), kThreads, 0, gpu_.stream.get()>>>(count, w_of_host_.data(),
                                                                              from_host_.data(), values_.data());
  call("launch of the addition to W", [&] { return cudaGetLastError(); });
}

void CudaMatrix::column_sizes(Span diagonal, Span largest) {
  const DeviceGuard guard(gpu_.number);
  const Columns c{columns_, w_ptr_.data(), k_ptr_.data(), w_ind_.data()};
  sizes_kernel<<<blocks_for(columns_ * kWarp, kThreads), kThreads, 0, gpu_.stream.get()>>>(
      c, values_.data(), sizes_.data(), sizes_.data() + columns_);
  call("launch of the sizes of columns", [&] { return cudaGetLastError(); });
  gpu_.fetch(sizes_.data(), diagonal);
  gpu_.fetch(sizes_.data() + columns_, largest);
}

const double* CudaMatrix::complete(ConstSpan scale, ConstSpan rest) {
  const DeviceGuard guard(gpu_.number);
  gpu_.send(scale, scale_.data());
  const Columns c{columns_, w_ptr_.data(), k_ptr_.data(), w_ind_.data()};
  scale_kernel<<<blocks_for(columns_ * kWarp, kThreads), kThreads, 0, gpu_.stream.get()>>>(c, scale_.data(),
                                                                                           values_.data());
  call("launch of the scaling", [&] { return cudaGetLastError(); });
  if (!rest.empty()) {
    gpu_.send(rest, from_host_.data());
    const auto count = static_cast<Offset>(rest.size());
    set_kernel<<<blocks_for(count, kThreads), kThreads, 0, gpu_.stream.get()>>>(count, rest_.data(), from_host_.data(),
                                                                                values_.data());
    call("launch of the entries of constraints", [&] { return cudaGetLastError(); });
  }
  return values_.data();
}

void CudaMatrix::set_scale(ConstSpan scale) {
  const DeviceGuard guard(gpu_.number);
  gpu_.send(scale, scale_.data());
}

std::unique_ptr<DeviceVectors> CudaMatrix::make_vectors() {
  return std::make_unique<CudaVectors>(unknowns_, scale_.data(), gpu_);
}

void CudaMatrix::sum_rows(ConstSpan x, Span out) const {
  const DeviceGuard guard(gpu_.number);
  const cudaStream_t stream = gpu_.stream.get();
  // The arrays of column_sizes() and of what comes from the host are free after complete().
  double* const largest = sizes_.data();
  const auto sums = reinterpret_cast<Bits*>(largest + columns_);
  static_assert(sizeof(Bits) == sizeof(double));
  call("cudaMemsetAsync",
       [&] { return cudaMemsetAsync(largest, 0, static_cast<std::size_t>(2 * columns_) * sizeof(double), stream); });
  gpu_.send(x, from_host_.data());
  const Columns c{columns_, w_ptr_.data(), k_ptr_.data(), w_ind_.data()};
  const unsigned blocks = blocks_for(columns_ * kWarp, kThreads);
  largest_terms_kernel<<<blocks, kThreads, 0, stream>>>(c, scale_.data(), values_.data(), from_host_.data(),
                                                        reinterpret_cast<Bits*>(largest));
  call("launch of the largest terms of rows", [&] { return cudaGetLastError(); });
  sum_terms_kernel<<<blocks, kThreads, 0, stream>>>(c, scale_.data(), values_.data(), from_host_.data(),
                                                    reinterpret_cast<const Bits*>(largest), sums);
  call("launch of the sums of rows", [&] { return cudaGetLastError(); });
  rows_kernel<<<blocks_for(columns_, kThreads), kThreads, 0, stream>>>(columns_, sums, largest);
  call("launch of the rows", [&] { return cudaGetLastError(); });
  gpu_.fetch(largest, out);
}

// In pieces of whole columns that fit what stands ready for the other way.
void CudaMatrix::fetch_w(Span values) const {
  const DeviceGuard guard(gpu_.number);
  std::vector<Offset> w_ptr(static_cast<std::size_t>(columns_) + 1);
  call("cudaMemcpyAsync", [&] {
    return cudaMemcpyAsync(w_ptr.data(), w_ptr_.data(), w_ptr.size() * sizeof(Offset), cudaMemcpyDeviceToHost,
                           gpu_.stream.get());
  });
  gpu_.stream.wait();
  for (Offset j = 0; j < columns_;) {
    const Offset begin = w_ptr[static_cast<std::size_t>(j)];
    const Offset next = std::upper_bound(w_ptr.begin() + j, w_ptr.end(), begin + room_) - w_ptr.begin() - 1;
    const Columns c{next - j, w_ptr_.data() + j, k_ptr_.data() + j, w_ind_.data()};
    unscale_kernel<<<blocks_for(c.count * kWarp, kThreads), kThreads, 0, gpu_.stream.get()>>>(
        c, j, scale_.data(), values_.data(), from_host_.data());
    call("launch of the taking out of scales", [&] { return cudaGetLastError(); });
    const Offset count = w_ptr[static_cast<std::size_t>(next)] - begin;
    gpu_.fetch(from_host_.data(), values.subspan(static_cast<std::size_t>(begin), static_cast<std::size_t>(count)));
    j = next;
  }
}

}  // namespace espalier::dynamics::cuda

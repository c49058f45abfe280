/// \file
/// Kernels over the equations on the device: scaling, permutation, residuals. Eight threads share a row.
#pragma once

#include <cstdint>

#include "espalier/types.hpp"

namespace espalier::device::cuda {

/// The pattern, its index by rows and its values; see EquationArrays.
struct DevicePattern {
  const Offset* col_ptr;
  const Index* row_ind;
  const Offset* row_ptr;  ///< null: the columns are the rows
  const Index* row_col;
  const std::uint32_t* row_source;
  const double* values;
  Index n;
  bool general;
};

constexpr int kLanes = 8;              ///< threads of a row
constexpr int kEquationThreads = 256;  ///< of a block

/// Calls use(value, column) for this lane's share of a row of op(A).
template <class Use>
__device__ inline void visit_row(const DevicePattern& p, Index row, bool transpose, int lane, Use&& use) {
  if (!p.general || transpose)
    for (Offset q = p.col_ptr[row] + lane; q < p.col_ptr[row + 1]; q += kLanes) use(p.values[q], p.row_ind[q]);
  if (p.row_ptr == nullptr || (p.general && transpose)) return;
  for (Offset q = p.row_ptr[row] + lane; q < p.row_ptr[row + 1]; q += kLanes)
    use(p.values[p.row_source[q]], p.row_col[q]);
}

/// *to = max(*to, x) for x >= 0: the bits of such numbers are ordered as the numbers are. Few warps raise the maximum;
/// the others only look at it, for atomic operations on one place come one after the other (1.5 ns each on an H200).
__device__ inline void raise(double* to, double x) {
  auto* place = reinterpret_cast<unsigned long long*>(to);
  const auto bits = static_cast<unsigned long long>(__double_as_longlong(x));
  if (bits > *static_cast<volatile unsigned long long*>(place)) atomicMax(place, bits);
}
__device__ inline double infinity() { return __longlong_as_double(0x7ff0000000000000LL); }
__device__ inline bool is_finite(double x) { return fabs(x) < infinity(); }

/// Sum over the lanes of a row, in a fixed order; every lane gets it.
__device__ inline double sum_lanes(double x) {
#pragma unroll
  for (int d = 1; d < kLanes; d *= 2) x += __shfl_xor_sync(0xffffffffu, x, d);
  return x;
}
__device__ inline double max_warp(double x) {
#pragma unroll
  for (int d = 1; d < 32; d *= 2) x = fmax(x, __shfl_xor_sync(0xffffffffu, x, d));
  return x;
}

/// A sum of products in twice the working precision: TwoProduct by fused multiply-add, TwoSum of Knuth.
struct LongSum {
  double high = 0, low = 0;

  __device__ void add(double x, double error) {
    const double s = __dadd_rn(high, x), z = __dsub_rn(s, high);
    low = __dadd_rn(low, __dadd_rn(__dadd_rn(__dsub_rn(high, __dsub_rn(s, z)), __dsub_rn(x, z)), error));
    high = s;
  }
  __device__ void subtract_product(double a, double b) {
    const double p = __dmul_rn(-a, b);
    add(p, __fma_rn(-a, b, -p));
  }
  __device__ void sum_lanes() {
#pragma unroll
    for (int d = 1; d < kLanes; d *= 2) {
      const double h = __shfl_xor_sync(0xffffffffu, high, d), l = __shfl_xor_sync(0xffffffffu, low, d);
      add(h, l);
    }
  }
};

/// found: 4 numbers for each right-hand side, as in DeviceResidual, zero before.
struct ResidualJob {
  const double* const* b;
  const double* const* x;
  double* const* r;
  double* found;
};

/// One right-hand side for each blockIdx.y.
__global__ void residual_kernel(DevicePattern p, bool transpose, ResidualJob job) {
  const int lane = static_cast<int>(threadIdx.x) % kLanes;
  const Offset at = (static_cast<Offset>(blockIdx.x) * kEquationThreads + threadIdx.x) / kLanes;
  const bool inside = at < p.n;
  const Index row = inside ? static_cast<Index>(at) : 0;
  const double* x = job.x[blockIdx.y];
  LongSum sum;
  double scale = 0;
  if (inside)
    visit_row(p, row, transpose, lane, [&](double v, Index c) {
      sum.subtract_product(v, x[c]);
      scale += fabs(v * x[c]);
    });
  sum.sum_lanes();
  scale = sum_lanes(scale);
  const double b = inside ? job.b[blockIdx.y][row] : 0, mine = inside ? x[row] : 0;
  sum.add(b, 0);
  scale += fabs(b);
  const double residual = sum.high + sum.low;
  double* r = job.r[blockIdx.y];
  if (inside && lane == 0 && r != nullptr) r[row] = residual;
  const double size = is_finite(residual) && is_finite(mine) ? fabs(residual) : infinity();
  const double relative = scale > 0 ? size / scale : (size == 0 ? 0.0 : infinity());
  const double most[4] = {max_warp(size), max_warp(is_finite(size) ? relative : infinity()), max_warp(fabs(mine)),
                          max_warp(fabs(b))};
  if (threadIdx.x % 32 == 0)
    for (int k = 0; k < 4; ++k) raise(job.found + 4 * blockIdx.y + k, most[k]);
}

/// *norm = |op(A)|_inf, zero before.
__global__ void norm_kernel(DevicePattern p, bool transpose, double* norm) {
  const int lane = static_cast<int>(threadIdx.x) % kLanes;
  const Offset row = (static_cast<Offset>(blockIdx.x) * kEquationThreads + threadIdx.x) / kLanes;
  double sum = 0;
  if (row < p.n) visit_row(p, static_cast<Index>(row), transpose, lane, [&](double v, Index) { sum += fabs(v); });
  sum = max_warp(sum_lanes(sum));
  if (threadIdx.x % 32 == 0) raise(norm, is_finite(sum) ? sum : infinity());
}

/// scaled = r_i a_ij c_j; found: [0] the largest magnitude, infinity when one is not finite; zero before.
template <class T>
__global__ void scale_kernel(DevicePattern p, const double* row_scale, const double* col_scale, T* scaled,
                             double* found) {
  const int lane = static_cast<int>(threadIdx.x) % kLanes;
  const Offset col = (static_cast<Offset>(blockIdx.x) * kEquationThreads + threadIdx.x) / kLanes;
  double most = 0;
  if (col < p.n) {
    const double c = col_scale != nullptr ? col_scale[col] : 1.0;
    for (Offset q = p.col_ptr[col] + lane; q < p.col_ptr[col + 1]; q += kLanes) {
      const double r = row_scale != nullptr ? row_scale[p.row_ind[q]] : 1.0;
      const T v = static_cast<T>(p.values[q] * c * r);
      scaled[q] = v;
      const double size = fabs(static_cast<double>(v));
      most = size < infinity() ? fmax(most, size) : infinity();
    }
  }
  most = max_warp(most);
  if (threadIdx.x % 32 == 0) raise(found, most);
}

/// How right-hand sides are permuted and scaled on their way to the factor and back; null: identity, ones.
struct Passage {
  const Index* order;
  const Index* row_of_col;
  const double* row_scale;
  const double* col_scale;
  Index n, columns, width;
  bool transpose;

  /// The equation (on the way in) or unknown (on the way out) at position k.
  __device__ Index place(Index k, bool out) const {
    const Index col = order[k];
    return (transpose == out && row_of_col != nullptr) ? row_of_col[col] : col;
  }
  __device__ double scale(Index i, bool out) const {
    const double* s = transpose == out ? row_scale : col_scale;
    return s != nullptr ? s[i] : 1.0;
  }
};

/// rhs (n x width, row-major, by position) = scaled b; columns beyond the last are zero.
template <class T>
__global__ void gather_kernel(Passage p, const double* b, T* rhs) {
  const Offset at = static_cast<Offset>(blockIdx.x) * kEquationThreads + threadIdx.x;
  if (at >= static_cast<Offset>(p.n) * p.width) return;
  const auto k = static_cast<Index>(at / p.width), c = static_cast<Index>(at % p.width);
  const Index i = p.place(k, false);
  rhs[at] = c < p.columns ? static_cast<T>(p.scale(i, false) * b[static_cast<Offset>(c) * p.n + i]) : T(0);
}

/// x = scaled rhs.
template <class T>
__global__ void scatter_kernel(Passage p, const T* rhs, double* x) {
  const Offset at = static_cast<Offset>(blockIdx.x) * kEquationThreads + threadIdx.x;
  if (at >= static_cast<Offset>(p.n) * p.width) return;
  const auto k = static_cast<Index>(at / p.width), c = static_cast<Index>(at % p.width);
  if (c >= p.columns) return;
  const Index i = p.place(k, true);
  x[static_cast<Offset>(c) * p.n + i] = p.scale(i, true) * static_cast<double>(rhs[at]);
}

/// to += from; found becomes infinity when some of `to` was not finite.
__global__ void add_kernel(Index n, const double* from, double* to, double* found) {
  const Offset i = static_cast<Offset>(blockIdx.x) * kEquationThreads + threadIdx.x;
  if (i >= n) return;
  if (!is_finite(to[i])) raise(found, infinity());
  to[i] += from[i];
}

template <class T>
__global__ void diagonal_kernel(Index n, const Offset* places, const T* scaled, double* to) {
  const Offset k = static_cast<Offset>(blockIdx.x) * kEquationThreads + threadIdx.x;
  if (k < n) to[k] = static_cast<double>(scaled[places[k]]);
}

}  // namespace espalier::device::cuda

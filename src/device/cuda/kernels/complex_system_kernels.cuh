/// \file
/// Kernels over a complex linear system whose real form is factorized (solver/analysis/real_form.hpp): its values
/// scaled and written as blocks of the real form, residuals, products. Numbers are pairs of doubles.
#pragma once

#include "device/cuda/kernels/linear_system_kernels.cuh"
#include "device/cuda/kernels/residual_kernels.cuh"

namespace espalier::device::cuda {

/// What the pattern of a complex system does not tell.
struct ComplexSystem {
  const Offset* real_columns;  ///< 2n + 1; where the columns of the real form's pattern begin
  bool hermitian;              ///< blocks [[a, -b], [b, a]]; else [[a, -b], [-b, -a]]
  bool lower, upper;           ///< which triangles are stored; of a diagonal block likewise
};

/// |x|; near the overflow and the underflow by hypot().
__device__ inline double magnitude(double2 x) {
  const double square = x.x * x.x + x.y * x.y;
  return square > 0x1p-900 && square < 0x1p900 ? sqrt(square) : hypot(x.x, x.y);
}

/// ValuesJob of complex values; `factored` counts those of the real form. The largest magnitude is that of a part;
/// infinity, too, where a diagonal entry of a Hermitian matrix is not real. A column for each group of lanes.
template <class T>
__global__ void __launch_bounds__(kSystemThreads)
    scale_complex_kernel(DevicePattern p, ComplexSystem system, const ValuesJob<T> job) {
  const int lane = static_cast<int>(threadIdx.x) % kLanes;
  const Offset step = static_cast<Offset>(gridDim.x) * kRowsOfBlock;
  const auto* const values = reinterpret_cast<const double2*>(job.values);
  auto* const copy = reinterpret_cast<double2*>(job.copy);
  const double sign = system.hermitian ? 1 : -1;
  double most = 0;
  for (Offset col = static_cast<Offset>(blockIdx.x) * kRowsOfBlock + threadIdx.x / kLanes; col < p.n; col += step) {
    const Offset begin = p.col_ptr[col], end = p.col_ptr[col + 1];
    const double c = job.col_scale != nullptr ? job.col_scale[col] : 1.0;
    // Entries stand in the order of their rows: a diagonal one is the first of a lower triangle, the last of an upper
    // one. Of its block one element is not stored.
    const bool short_second = !system.upper && begin < end && p.row_ind[begin] == col;
    for (Offset q = begin + lane; q < end; q += kLanes) {
      const Index row = p.row_ind[q];
      const double2 v = values[q];
      const double r = job.row_scale != nullptr ? job.row_scale[row] : 1.0;
      const double re = v.x * c * r, im = v.y * c * r;
      if (copy != nullptr) copy[q] = v;
      const bool diagonal = row == col;
      const auto store = [&](Offset at, double x) {
        if (at < job.factored) job.scaled[at] = static_cast<T>(x);
      };
      const Offset first = system.real_columns[2 * col] + 2 * (q - begin);
      const Offset second = system.real_columns[2 * col + 1] + 2 * (q - begin) - (short_second && q > begin ? 1 : 0);
      store(first, re);
      if (!diagonal || system.lower) store(first + 1, sign * im);
      if (!diagonal || system.upper) store(second, -im);
      store(second + (diagonal && !system.upper ? 0 : 1), sign * re);
      most = larger(
          most, larger(fabs(static_cast<double>(static_cast<T>(re))), fabs(static_cast<double>(static_cast<T>(im)))));
      if (system.hermitian && diagonal && v.y != 0) most = infinity();
    }
  }
  most = largest_of_block(most);
  if (threadIdx.x == 0) job.largest[blockIdx.x] = most;
}

/// The parts of a complex sum in twice the working precision, and the sum of its terms' magnitudes.
struct LongComplexSum {
  LongSum re, im;
  double scale = 0;

  __device__ void subtract_product(double2 a, double2 b) {
    re.subtract_product(a.x, b.x);
    re.subtract_product(-a.y, b.y);
    im.subtract_product(a.x, b.y);
    im.subtract_product(a.y, b.x);
    const double plain = (a.x * a.x + a.y * a.y) * (b.x * b.x + b.y * b.y);
    scale += plain > 0x1p-900 && plain < 0x1p900 ? sqrt(plain) : hypot(a.x, a.y) * hypot(b.x, b.y);
  }
};

/// Calls use(value, x of its column) for this lane's share of a row of op(A). Of a Hermitian matrix a column is the
/// conjugate of the row.
template <class Use>
__device__ inline void visit_complex_row(const DevicePattern& p, bool hermitian, Index row, bool transpose, int lane,
                                         const double2* x, Use&& use) {
  const auto mirrored = [&](double2 v, double2 other) { use(hermitian ? double2{v.x, -v.y} : v, other); };
  visit_row_ahead<2>(p, row, transpose, lane, x, mirrored, use);
}

/// As residual_kernel() for one right-hand side, that of the number blockIdx.y.
__global__ void __launch_bounds__(kSystemThreads)
    complex_residual_kernel(const DevicePattern p, bool hermitian, const __grid_constant__ ResidualJob job) {
  if (blockIdx.x == 0 && blockIdx.y == 0 && threadIdx.x == 0) job.clock[1] = nanoseconds_now();
  const int lane = static_cast<int>(threadIdx.x) % kLanes;
  const Offset step = static_cast<Offset>(gridDim.x) * kRowsOfBlock;
  const Offset mine = threadIdx.x / kLanes;
  const auto* const b = reinterpret_cast<const double2*>(job.b[blockIdx.y]);
  const auto* const x = reinterpret_cast<const double2*>(job.x[blockIdx.y]);
  auto* const r = reinterpret_cast<double2*>(job.r[blockIdx.y]);
  ResidualSizes sizes;
  for (Offset first = static_cast<Offset>(blockIdx.x) * kRowsOfBlock; first < p.n; first += step) {
    const bool inside = first + mine < p.n;
    const Index row = inside ? static_cast<Index>(first + mine) : 0;
    LongComplexSum sum;
    double norm = 0;
    if (inside)
      visit_complex_row(p, hermitian, row, job.transpose, lane, x, [&](double2 v, double2 other) {
        sum.subtract_product(v, other);
        norm += magnitude(v);
      });
    sum.re.sum_lanes();
    sum.im.sum_lanes();
    const double scale = sum_lanes(sum.scale);
    norm = sum_lanes(norm);
    if (!inside) continue;
    const double2 of_b = b[row], of_x = x[row];
    sum.re.add(of_b.x, 0);
    sum.im.add(of_b.y, 0);
    const double2 residual = {sum.re.high + sum.re.low, sum.im.high + sum.im.low};
    if (r != nullptr && lane == 0) r[row] = residual;
    const double size = magnitude(of_b);
    sizes.add(magnitude(residual), scale + size, magnitude(of_x), size, norm);
  }
  report_sizes<1>(sizes, job);
}

/// y = op(A) x in plain double precision.
__global__ void __launch_bounds__(kSystemThreads)
    complex_multiply_kernel(const DevicePattern p, bool hermitian, const double* x, double* y, bool transpose) {
  const int lane = static_cast<int>(threadIdx.x) % kLanes;
  const Offset step = static_cast<Offset>(gridDim.x) * kRowsOfBlock;
  const Offset mine = threadIdx.x / kLanes;
  for (Offset first = static_cast<Offset>(blockIdx.x) * kRowsOfBlock; first < p.n; first += step) {
    const bool inside = first + mine < p.n;
    const Index row = inside ? static_cast<Index>(first + mine) : 0;
    double re = 0, im = 0;
    if (inside)
      visit_complex_row(p, hermitian, row, transpose, lane, reinterpret_cast<const double2*>(x),
                        [&](double2 v, double2 other) {
                          re += v.x * other.x - v.y * other.y;
                          im += v.x * other.y + v.y * other.x;
                        });
    re = sum_lanes(re);
    im = sum_lanes(im);
    if (inside && lane == 0) reinterpret_cast<double2*>(y)[row] = {re, im};
  }
}

}  // namespace espalier::device::cuda

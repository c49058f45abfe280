/// \file
/// Block-diagonal systems of equal parts, none of which is coupled with another one: residuals with what each part
/// says of its solution, and copies of parts. A block of kSystemThreads has a part.
#pragma once

#include "device/cuda/kernels/residual_kernels.cuh"

namespace espalier::device::cuda {

struct PartResidualJob {  // vectors of one column after another
  const double* b;
  const double* x;
  double* r;   ///< may be null
  Index rows;  ///< of a part
  bool transpose;
  double* found;  ///< columns x parts x ResidualSizes: pinned memory that the GPU writes
};

/// The residuals are those of residual_kernel<1, Batch>. Grid: parts x columns.
template <int Batch>
__global__ void __launch_bounds__(kSystemThreads)
    part_residual_kernel(const DevicePattern p, const __grid_constant__ PartResidualJob job) {
  const int lane = static_cast<int>(threadIdx.x) % kLanes;
  const auto mine = static_cast<Index>(threadIdx.x / kLanes);
  const Offset begin = static_cast<Offset>(blockIdx.x) * job.rows, column = static_cast<Offset>(blockIdx.y) * p.n;
  const double *const b = job.b + column, *const x = job.x + column;
  ResidualSizes sizes;
  for (Index first = 0; first < job.rows; first += kRowsOfBlock) {
    const bool inside = first + mine < job.rows;
    const auto row = static_cast<Index>(begin + (inside ? first + mine : 0));
    RowSums sums;
    const auto take = [&](double v, double other) { sums.take(v, other); };
    if (inside) visit_row_ahead<Batch>(p, row, job.transpose, lane, x, take, take);
    sums.sum_lanes();
    if (!inside) continue;
    const double residual = sums.finish(b[row], x[row], sizes);
    if (job.r != nullptr && lane == 0) job.r[column + row] = residual;
  }
#pragma unroll
  for (int k = 0; k < ResidualSizes::kCount; ++k) {
    const double most = largest_of_block(sizes.of[k]);
    const Offset part = static_cast<Offset>(blockIdx.y) * gridDim.x + blockIdx.x;
    if (threadIdx.x == 0) job.found[part * ResidualSizes::kCount + k] = most;
  }
}

/// to = from in the parts that are taken (not 0; pinned memory), of one column after another. Grid: all of them.
__global__ void __launch_bounds__(kSystemThreads)
    copy_parts_kernel(Index rows, const char* taken, const double* from, double* to) {
  if (taken[blockIdx.x] == 0) return;
  const Offset begin = static_cast<Offset>(blockIdx.x) * rows;
  for (Index k = static_cast<Index>(threadIdx.x); k < rows; k += kSystemThreads) to[begin + k] = from[begin + k];
}

}  // namespace espalier::device::cuda

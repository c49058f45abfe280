/// \file
/// The pattern of the equations on the device, and how the threads of a group walk along a row. Eight share one.
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

constexpr int kLanes = 8;                                ///< threads of a row
constexpr int kEquationThreads = 256;                    ///< of a block
constexpr int kRowsOfBlock = kEquationThreads / kLanes;  ///< that it has at a time

/// Calls use(value, column) for this lane's share of a row of op(A).
template <class Use>
__device__ inline void visit_row(const DevicePattern& p, Index row, bool transpose, int lane, Use&& use) {
  if (!p.general || transpose)
    for (Offset q = p.col_ptr[row] + lane; q < p.col_ptr[row + 1]; q += kLanes) use(p.values[q], p.row_ind[q]);
  if (p.row_ptr == nullptr || (p.general && transpose)) return;
  for (Offset q = p.row_ptr[row] + lane; q < p.row_ptr[row + 1]; q += kLanes)
    use(p.values[p.row_source[q]], p.row_col[q]);
}

/// Sum over the lanes of a row, in a fixed order; every lane gets it.
__device__ inline double sum_lanes(double x) {
#pragma unroll
  for (int d = 1; d < kLanes; d *= 2) x += __shfl_xor_sync(0xffffffffu, x, d);
  return x;
}

/// The device's clock.
__device__ inline unsigned long long nanoseconds_now() {
  unsigned long long t;
  asm volatile("mov.u64 %0,%%globaltimer;" : "=l"(t));
  return t;
}

}  // namespace espalier::device::cuda

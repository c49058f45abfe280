/// \file
/// The pattern of the matrix on the device, and how the threads of a group walk along a row. Eight share one.
#pragma once

#include <cstdint>

#include "espalier/types.hpp"

namespace espalier::device::cuda {

/// The pattern, its index by rows and its values; see LinearSystemArrays.
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

constexpr int kLanes = 8;                              ///< threads of a row
constexpr int kSystemThreads = 256;                    ///< of a block
constexpr int kRowsOfBlock = kSystemThreads / kLanes;  ///< that it has at a time

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

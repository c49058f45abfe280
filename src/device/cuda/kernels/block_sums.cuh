/// \file
/// What the blocks of a kernel find, put together by the last of them to finish. Results do not depend on which that
/// is.
#pragma once

#include "espalier/types.hpp"

namespace espalier::device::cuda {

__device__ inline double infinity() { return __longlong_as_double(0x7ff0000000000000LL); }
__device__ inline bool is_finite(double x) { return fabs(x) < infinity(); }
/// The larger; infinity for what is not a number.
__device__ inline double larger(double a, double b) {
  return a < infinity() && b < infinity() ? fmax(a, b) : infinity();
}
__device__ inline double largest_of_warp(double x) {
#pragma unroll
  for (int d = 1; d < 32; d *= 2) x = larger(x, __shfl_xor_sync(0xffffffffu, x, d));
  return x;
}

/// Largest of the block's numbers, for thread 0 alone. By all threads of a block of at most 1024, a multiple of 32.
__device__ inline double largest_of_block(double x) {
  __shared__ double warps[32];
  x = largest_of_warp(x);
  if (threadIdx.x % 32 == 0) warps[threadIdx.x / 32] = x;
  __syncthreads();
  if (threadIdx.x < 32) x = largest_of_warp(threadIdx.x < blockDim.x / 32 ? warps[threadIdx.x] : 0);
  __syncthreads();
  return x;
}

/// Whether this is the last block of the grid to come here; what all of them wrote before is then visible to it. By all
/// threads. *ticket is zero before the kernel and after it.
__device__ inline bool last_block(int* ticket) {
  __shared__ int last;
  __threadfence();
  __syncthreads();
  if (threadIdx.x == 0) {
    const int blocks = static_cast<int>(gridDim.x * gridDim.y);
    last = atomicAdd(ticket, 1) + 1 == blocks ? 1 : 0;
    if (last != 0) *ticket = 0;
    __threadfence();
  }
  __syncthreads();
  return last != 0;
}

}  // namespace espalier::device::cuda

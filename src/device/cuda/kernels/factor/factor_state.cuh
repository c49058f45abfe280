/// \file
/// How the blocks of a kernel wait for each other.
#pragma once

#include "device/cuda/kernels/factor/factor_parameters.hpp"
#include "device/cuda/kernels/intrinsics.cuh"

namespace espalier::device::cuda {

/// True when the whole run is to end: results are then undefined, but every address stays valid.
__device__ inline bool aborted(const int* control) { return load_relaxed(control + kAborted) != 0; }

/// Spins until *flag >= wanted. Gives up when the run is aborted or the wait lasts too long, and then aborts the run.
/// @returns nanoseconds
__device__ inline unsigned wait_for(const int* flag, int wanted, int* control, std::uint64_t patience) {
  if (load_acquire(flag) >= wanted) return 0;
  const std::uint64_t start = global_nanoseconds();
  for (int n = 1;; ++n) {
    if (load_acquire(flag) >= wanted) break;
    if ((n & 15) == 0) {
      if (aborted(control)) break;
      if (global_nanoseconds() - start > patience) {
        atomicExch(control + kAborted, 1);
        break;
      }
      __nanosleep(64);
    }
  }
  return static_cast<unsigned>(global_nanoseconds() - start);
}

}  // namespace espalier::device::cuda

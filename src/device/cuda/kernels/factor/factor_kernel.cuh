/// \file
/// The persistent factorization kernel, as plain C++.
#pragma once

#include <cuda_runtime_api.h>

#include <cstddef>

#include "device/cuda/tables/tables.hpp"
#include "espalier/types.hpp"

namespace espalier::device::cuda {

template <class T>
struct FactorState;

/// How a kernel is launched on one device.
struct LaunchConfiguration {
  int blocks = 0;  ///< all resident at the same time
  int stages = 0;
  std::size_t shared_bytes = 0;
};

/// The kernel for one kind; instantiated for double and float. Half: of real forms of complex systems, see
/// half_products.cuh; for double alone.
template <class T, Kind K, bool Half = false>
struct FactorKernel {
  /// Launch shape for the current device. wide: the variant that knows tile columns of 64.
  /// @param whole_elements  elements of shared memory that the largest whole front needs
  static cudaError_t shape_for(bool wide, std::size_t whole_elements, LaunchConfiguration& shape);

  /// Whether the code for the current device takes Work::two_columns: FP32 by warpgroups (warpgroup_products.cuh).
  static cudaError_t takes_two_columns(bool& takes);

  /// Runs tasks [first, end) of the state's list; the state's control and finished arrays must be zero before the first
  /// of the two kernels of a factorization.
  /// @param pair_sign  Half: 1, or -1 of a Hermitian matrix
  static cudaError_t launch(bool wide, const LaunchConfiguration& shape, const FactorState<T>& state, int first,
                            int end, int n, cudaStream_t stream, int pair_sign = 0);
};

}  // namespace espalier::device::cuda

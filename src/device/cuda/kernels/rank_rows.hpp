/// \file
/// A solution gathered from the GPUs of ranks. As plain C++.
#pragma once

#include <cuda_runtime_api.h>

#include "device/cuda/kernels/factor/factor_parameters.hpp"
#include "espalier/types.hpp"

namespace espalier::device::cuda {

/// Pointers are device memory, those of `from` also of other GPUs. Vectors are row-major, `columns` values a row.
template <class T>
struct RankRowsJob {
  const T* from[kMostDevices];  ///< by rank: a vector in which its own rows are right
  T* to;
  const unsigned char* owner;  ///< rows; whose each is
  Offset rows;
  Index columns;
};

/// to = each row from its owner.
template <class T>
cudaError_t launch_gather_rows(const RankRowsJob<T>& job, cudaStream_t stream);

}  // namespace espalier::device::cuda

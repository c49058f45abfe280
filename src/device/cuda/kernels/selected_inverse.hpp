/// \file
/// The kernels that make entries of an inverse (tables/inverse_tables.hpp), as plain C++.
#pragma once

#include <cuda_runtime_api.h>

#include "device/cuda/tables/inverse_tables.hpp"

namespace espalier::device::cuda {

/// What all launches get. All pointers are device memory.
template <class T>
struct InverseState {
  Kind kind = Kind::llt;
  const InverseFrontOf<T>* fronts = nullptr;
  const InverseTask* tasks = nullptr;
  const std::int32_t* relative = nullptr;  ///< Plan::relative
  const T* inverse_d = nullptr;            ///< ldlt; FactorState::inverse_d
  const T* inverse_e = nullptr;
  const T* stack = nullptr;
  const std::int64_t* address = nullptr;  ///< of entries in the stack, in the order of launches
  T* entry = nullptr;                     ///< likewise; written
};

/// For the current device, before the first launch.
template <class T>
cudaError_t prepare_inverse();

/// Enqueues one launch; of InverseWork::read, begin and end are those of addresses.
template <class T>
cudaError_t launch_inverse(const InverseState<T>& state, const InverseLaunch& launch, cudaStream_t stream);

}  // namespace espalier::device::cuda

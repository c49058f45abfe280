/// \file
/// device::DeviceLinearSystem on the first GPU of an executor. No CUDA header is needed.
#pragma once

#include <memory>

#include "device/cuda/executor/cuda_executor.hpp"
#include "device/device_linear_system.hpp"

namespace espalier::device::cuda {

/// @param executor  must outlive the object
/// @param memory_bytes  budget for everything taken here; 0: what is free
/// @throws Error(out_of_memory), Error(device_error)
template <class T>
std::unique_ptr<DeviceLinearSystem> make_device_linear_system(const LinearSystemArrays& arrays,
                                                              CudaExecutor<T>& executor, int device,
                                                              Offset memory_bytes);

}  // namespace espalier::device::cuda

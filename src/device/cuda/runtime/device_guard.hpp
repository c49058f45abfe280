/// \file
/// Makes a GPU the current one of the calling thread for a while.
#pragma once

#include <cuda_runtime_api.h>

#include <new>

#include "device/cuda/runtime/device_memory.hpp"

namespace espalier::device::cuda {

/// Makes a device current for its lifetime.
class DeviceGuard {
 public:
  explicit DeviceGuard(int device) {
    call("cudaGetDevice", [&] { return cudaGetDevice(&before_); });
    changed_ = before_ != device;
    if (changed_) call("cudaSetDevice", [&] { return cudaSetDevice(device); });
  }
  /// Where nothing may be thrown, as in destructors: what fails there is left as it is, and not counted.
  DeviceGuard(int device, std::nothrow_t /*tag*/) noexcept {
    changed_ = cudaGetDevice(&before_) == cudaSuccess && before_ != device && cudaSetDevice(device) == cudaSuccess;
  }
  DeviceGuard(const DeviceGuard&) = delete;
  DeviceGuard& operator=(const DeviceGuard&) = delete;
  ~DeviceGuard() {
    if (changed_) (void)cudaSetDevice(before_);
  }

 private:
  int before_ = 0;
  bool changed_ = false;
};

}  // namespace espalier::device::cuda

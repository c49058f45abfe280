/// \file
/// Pins an array of the caller's, which a GPU reads. For this backend alone: needs the CUDA runtime.
#pragma once

#include <cuda_runtime_api.h>

#include <memory>
#include <span>

namespace espalier::device::cuda {

class PinnedValues {
 public:
  /// The device is current; the array outlives this object. Where it is refused, copies are slower, but nothing else
  /// changes.
  void pin(std::span<const double> values) {
    auto* p = const_cast<double*>(values.data());  // the device only reads
    if (!values.empty() && cudaHostRegister(p, values.size_bytes(), cudaHostRegisterDefault) == cudaSuccess)
      pinned_.reset(p);
    (void)cudaGetLastError();
  }
  [[nodiscard]] bool are_pinned() const { return pinned_ != nullptr; }

 private:
  struct Unpin {
    void operator()(double* p) const { (void)cudaHostUnregister(p); }
  };
  std::unique_ptr<double, Unpin> pinned_;
};

}  // namespace espalier::device::cuda

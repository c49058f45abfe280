// The backend in builds without CUDA.
#include "device/cuda/executor/cuda_executor.hpp"

#if !ESPALIER_WITH_CUDA

namespace espalier::device::cuda {

namespace {
constexpr const char* kReason =
    "this build of espalier has no CUDA backend (configure with -DESPALIER_CUDA=ON where nvcc is installed)";
}

Availability available_devices() { return {{}, kReason}; }

void open_devices(const std::vector<int>&) noexcept {}

template <class T>
std::unique_ptr<CudaExecutor<T>> make_cuda_executor(const plan::Plan&, Kind, const PivotRule&, const CudaOptions&) {
  throw Error(StatusCode::device_error, kReason);
}

template std::unique_ptr<CudaExecutor<double>> make_cuda_executor(const plan::Plan&, Kind, const PivotRule&,
                                                                  const CudaOptions&);
template std::unique_ptr<CudaExecutor<float>> make_cuda_executor(const plan::Plan&, Kind, const PivotRule&,
                                                                 const CudaOptions&);

}  // namespace espalier::device::cuda

#endif

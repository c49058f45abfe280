// Streaming in builds without CUDA.
#include "device/cuda/out_of_core/cuda_stream.hpp"

#if !ESPALIER_WITH_CUDA

namespace espalier::device::cuda {

namespace {
constexpr const char* kReason =
    "this build of espalier has no CUDA backend (configure with -DESPALIER_CUDA=ON where nvcc is installed)";
}

Offset free_device_bytes(int) { throw Error(StatusCode::device_error, kReason); }

template <class T>
std::vector<std::unique_ptr<out_of_core::StreamBackend<T>>> make_cuda_streams(const plan::Plan&, Kind, const PivotRule&,
                                                                              base::ThreadPool&,
                                                                              const std::vector<CudaStreamOptions>&) {
  throw Error(StatusCode::device_error, kReason);
}

template std::vector<std::unique_ptr<out_of_core::StreamBackend<double>>> make_cuda_streams(
    const plan::Plan&, Kind, const PivotRule&, base::ThreadPool&, const std::vector<CudaStreamOptions>&);
template std::vector<std::unique_ptr<out_of_core::StreamBackend<float>>> make_cuda_streams(
    const plan::Plan&, Kind, const PivotRule&, base::ThreadPool&, const std::vector<CudaStreamOptions>&);

}  // namespace espalier::device::cuda

#endif

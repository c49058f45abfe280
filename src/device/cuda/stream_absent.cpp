// Streaming in builds without CUDA.
#include "device/cuda/cuda_stream.hpp"

#if !ESPALIER_WITH_CUDA

namespace espalier::device::cuda {

namespace {
constexpr const char* kReason =
    "this build of espalier has no CUDA backend (configure with -DESPALIER_CUDA=ON where nvcc is installed)";
}

Offset free_device_bytes(int) { throw Error(StatusCode::device_error, kReason); }

template <class T>
std::vector<std::unique_ptr<StreamBackend<T>>> make_cuda_streams(const analysis::Plan&, Kind, const PivotRule&,
                                                                 base::ThreadPool&,
                                                                 const std::vector<CudaStreamOptions>&) {
  throw Error(StatusCode::device_error, kReason);
}

template std::vector<std::unique_ptr<StreamBackend<double>>> make_cuda_streams(const analysis::Plan&, Kind,
                                                                               const PivotRule&, base::ThreadPool&,
                                                                               const std::vector<CudaStreamOptions>&);
template std::vector<std::unique_ptr<StreamBackend<float>>> make_cuda_streams(const analysis::Plan&, Kind,
                                                                              const PivotRule&, base::ThreadPool&,
                                                                              const std::vector<CudaStreamOptions>&);

}  // namespace espalier::device::cuda

#endif

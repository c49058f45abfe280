#include "device/cuda/kernels/solve/solve_kernel_impl.cuh"

namespace espalier::device::cuda {

template struct SolveKernel<float>;
template cudaError_t launch_copy<float>(float*, const float*, std::int64_t, cudaStream_t);

}  // namespace espalier::device::cuda

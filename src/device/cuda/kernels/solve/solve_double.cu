#include "device/cuda/kernels/solve/solve_kernel_impl.cuh"

namespace espalier::device::cuda {

template struct SolveKernel<double>;
template cudaError_t launch_copy<double>(double*, const double*, std::int64_t, cudaStream_t);

}  // namespace espalier::device::cuda

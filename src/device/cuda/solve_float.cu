#include "device/cuda/solve_kernel_impl.cuh"

namespace espalier::device::cuda {

template struct SolveKernel<float>;

}  // namespace espalier::device::cuda

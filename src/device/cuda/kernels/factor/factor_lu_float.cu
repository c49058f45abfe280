#include "device/cuda/kernels/factor/factor_kernel_impl.cuh"

namespace espalier::device::cuda {

template struct FactorKernel<float, Kind::lu>;

}  // namespace espalier::device::cuda

#include "device/cuda/kernels/factor/factor_kernel_impl.cuh"

namespace espalier::device::cuda {

template struct FactorKernel<double, Kind::llt, true>;

}  // namespace espalier::device::cuda

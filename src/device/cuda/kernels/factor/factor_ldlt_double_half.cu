#include "device/cuda/kernels/factor/factor_kernel_impl.cuh"

namespace espalier::device::cuda {

template struct FactorKernel<double, Kind::ldlt, true>;

}  // namespace espalier::device::cuda

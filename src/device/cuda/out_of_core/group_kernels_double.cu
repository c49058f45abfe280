#include "device/cuda/out_of_core/group_kernels_impl.cuh"

namespace espalier::device::cuda {

template struct GroupKernels<double, Kind::llt>;
template struct GroupKernels<double, Kind::ldlt>;
template struct GroupKernels<double, Kind::lu>;

}  // namespace espalier::device::cuda

#include "device/cuda/out_of_core/group_kernels_impl.cuh"

namespace espalier::device::cuda {

template struct GroupKernels<float, Kind::llt>;
template struct GroupKernels<float, Kind::ldlt>;
template struct GroupKernels<float, Kind::lu>;

}  // namespace espalier::device::cuda

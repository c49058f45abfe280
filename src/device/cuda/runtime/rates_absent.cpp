// Rates of GPUs in builds without CUDA.
#include "device/cuda/runtime/device_rates.hpp"

#if !ESPALIER_WITH_CUDA

namespace espalier::device::cuda {

DeviceRates measured_rates(int) { return {0, 0, "this build of espalier has no CUDA backend"}; }

}  // namespace espalier::device::cuda

#endif

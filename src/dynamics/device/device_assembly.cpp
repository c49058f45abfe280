#include "dynamics/device/device_assembly.hpp"

namespace espalier::dynamics {

#ifdef ESPALIER_DYNAMICS_CUDA

namespace cuda {
std::unique_ptr<DeviceAssembly> make_device_assembly(const GpuPlaces& places, base::ThreadPool* pool);
}
std::unique_ptr<DeviceAssembly> make_device_assembly(const GpuPlaces& places, base::ThreadPool* pool) {
  return cuda::make_device_assembly(places, pool);
}

#else

std::unique_ptr<DeviceAssembly> make_device_assembly(const GpuPlaces& /*places*/, base::ThreadPool* /*pool*/) {
  return nullptr;
}

#endif

}  // namespace espalier::dynamics

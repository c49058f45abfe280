// Equations on a device in builds without CUDA.
#include "device/cuda/executor/device_equations.hpp"

#if !ESPALIER_WITH_CUDA

namespace espalier::device::cuda {

template <class T>
std::unique_ptr<DeviceEquations<T>> make_device_equations(const EquationArrays&, CudaExecutor<T>&, int, Offset) {
  throw Error(StatusCode::device_error, "this build of espalier has no CUDA backend");
}

template std::unique_ptr<DeviceEquations<double>> make_device_equations(const EquationArrays&, CudaExecutor<double>&,
                                                                        int, Offset);
template std::unique_ptr<DeviceEquations<float>> make_device_equations(const EquationArrays&, CudaExecutor<float>&, int,
                                                                       Offset);

}  // namespace espalier::device::cuda

#endif

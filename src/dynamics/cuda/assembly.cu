#include "dynamics/cuda/body.hpp"
#include "dynamics/cuda/matrix.hpp"
#include "dynamics/cuda/motion.hpp"

namespace espalier::dynamics::cuda {

namespace {

class CudaAssembly final : public DeviceAssembly {
 public:
  CudaAssembly(int number, base::ThreadPool* pool) : gpu_(number, DeviceBudget(free_memory()), pool) {}
  std::unique_ptr<DeviceBody> make_body(const DeviceBodyTables& tables) override {
    return std::make_unique<CudaBody>(tables, gpu_);
  }
  std::unique_ptr<DeviceMatrix> make_matrix(const DeviceMatrixLayout& layout) override {
    return std::make_unique<CudaMatrix>(layout, gpu_);
  }
  std::unique_ptr<DeviceMotion> make_motion(const Sizes& sizes, const MotionDemand& demand,
                                            const DeviceShare& share) override {
    return std::make_unique<CudaMotion>(sizes, demand, share, gpu_);
  }

 private:
  static Offset free_memory() {
    std::size_t left = 0, all = 0;
    call("cudaMemGetInfo", [&] { return cudaMemGetInfo(&left, &all); });
    return static_cast<Offset>(left);
  }

  Gpu gpu_;
};

}  // namespace

std::unique_ptr<DeviceAssembly> make_device_assembly(int gpu, base::ThreadPool* pool) {
  const DeviceGuard guard(gpu);
  return std::make_unique<CudaAssembly>(gpu, pool);
}

}  // namespace espalier::dynamics::cuda

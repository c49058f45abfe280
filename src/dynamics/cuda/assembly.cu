#include "dynamics/cuda/body.hpp"
#include "dynamics/cuda/carrier.hpp"
#include "dynamics/cuda/matrix.hpp"
#include "dynamics/cuda/motion.hpp"

namespace espalier::dynamics::cuda {

namespace {

std::unique_ptr<Gpu> open(int number, base::ThreadPool* pool) {
  const DeviceGuard guard(number);
  std::size_t left = 0, all = 0;
  call("cudaMemGetInfo", [&] { return cudaMemGetInfo(&left, &all); });
  return std::make_unique<Gpu>(number, DeviceBudget(static_cast<Offset>(left)), pool);
}

class CudaAssembly final : public DeviceAssembly {
 public:
  CudaAssembly(const GpuPlaces& places, base::ThreadPool* pool)
      : places_(places), pool_(pool), first_(open(places.gpus.at(0), pool)), own_(places.gpus.size()) {}
  std::unique_ptr<DeviceBody> make_body(const DeviceBodyTables& tables) override {
    try {
      const auto make = [this](const BodySubdomain& part) { return make_part(part); };
      if (auto divided = make_divided_body(tables, places_, fewest_, pool_, make)) return divided;
    } catch (const Error& error) {  // the first GPU may have room for all of it
      if (error.status().code != StatusCode::out_of_memory) throw;
    }
    return std::make_unique<CudaBody>(tables, *first_);
  }
  std::unique_ptr<DeviceMatrix> make_matrix(const DeviceMatrixLayout& layout) override {
    return std::make_unique<CudaMatrix>(layout, *first_);
  }
  std::unique_ptr<DeviceMotion> make_motion(const Sizes& sizes, const MotionDemand& demand,
                                            const DeviceShare& share) override {
    return std::make_unique<CudaMotion>(sizes, demand, share, *first_);
  }

 private:
  // Parts on the first GPU have a stream of their own, too: there, states leave while elements are at work.
  SubdomainOnGpu make_part(const BodySubdomain& part) {
    std::unique_ptr<Gpu>& own = own_[static_cast<std::size_t>(part.place)];
    if (own == nullptr) own = open(places_.gpus[static_cast<std::size_t>(part.place)], pool_);
    return {std::make_unique<CudaBody>(part.tables(), *own), std::make_unique<CudaCarrier>(part, *first_, *own),
            part.place == 0};
  }

  GpuPlaces places_;
  base::ThreadPool* pool_;
  std::unique_ptr<Gpu> first_;
  std::vector<std::unique_ptr<Gpu>> own_;  // of parts, by place; null: there are none so far
};

}  // namespace

std::unique_ptr<DeviceAssembly> make_device_assembly(const GpuPlaces& places, base::ThreadPool* pool) {
  return std::make_unique<CudaAssembly>(places, pool);
}

}  // namespace espalier::dynamics::cuda

// GPUs of NVIDIA as a backend.
#include "device/backend.hpp"

#include "device/cuda/executor/cuda_executor.hpp"
#include "device/cuda/executor/rank_executor.hpp"
#include "device/cuda/executor/tall_space.hpp"
#include "device/cuda/out_of_core/backend.hpp"
#include "device/cuda/runtime/device_rates.hpp"
#include "device/cuda/tables/device_plan.hpp"
#include "device/cuda/tables/front_shape.hpp"
#include "out_of_core/factory.hpp"

namespace espalier::device::cuda {

namespace {

struct CudaOutOfCore {
  template <class T>
  static std::vector<std::unique_ptr<out_of_core::OutOfCoreBackend<T>>> all(const Job& job) {
    std::vector<CudaOutOfCoreOptions> devices(job.devices.size());
    for (std::size_t d = 0; d < devices.size(); ++d) devices[d].device = job.devices[d];
    return make_cuda_out_of_core_backends<T>(job.plan, job.kind, job.rule, job.pool, devices);
  }
};

class CudaBackend final : public Backend {
 public:
  [[nodiscard]] std::string_view name() const override { return "gpu"; }
  [[nodiscard]] std::string_view noun() const override { return "GPU"; }
  [[nodiscard]] FoundDevices find() const override {
    Availability available = available_devices();
    FoundDevices found;
    for (DeviceInfo& info : available.devices) found.names.push_back(std::move(info.name));
    found.reason = std::move(available.reason);
    return found;
  }
  [[nodiscard]] Limits limits() const override {
    Limits limits;
    limits.most_devices = kMostDevices;
    limits.widest_tile = kWideTiles;
    limits.own_memory = true;
    limits.ranks = true;
    return limits;
  }

  [[nodiscard]] const plan::MachineModel& model(const plan::Machine& machine) const override { return machine.gpu; }
  [[nodiscard]] PredictedTime predict(const analysis::AssemblyTree& tree, const PlanWish& wish) const override {
    const plan::MachineModel& gpu = model(wish.machine);
    return {gpu.start, true, plan::gpu_time(tree, wish.kind, wish.precision != Precision::fp64, gpu)};
  }
  [[nodiscard]] plan::PlanOptions plan_options(const PlanWish& wish) const override {
    DeviceTuning tuning;
    tuning.max_block_size = wish.max_block_size;
    tuning.additional_subtrees = wish.sharing.additional_subtrees;
    tuning.stealing = wish.sharing.stealing && wish.unequal;  // among equal ones it only costs (measured)
    tuning.shared_top = wish.sharing.shared_top;
    tuning.device_speed = wish.speed;
    tuning.machine = model(wish.machine);
    plan::PlanOptions options = cuda_plan_options(wish.kind, tuning, wish.devices);
    // Several would keep theirs, too, but have not been seen to do so: no two GPUs were to be had.
    options.keep_contributions = wish.keep_contributions && wish.devices == 1 && wish.ranks == 1;
    return options;
  }

  [[nodiscard]] Offset executor_bytes(const plan::Plan& plan, Kind, Precision precision, int) const override {
    const std::size_t value = precision == Precision::fp64 ? sizeof(double) : sizeof(float);
    return plan.memory.size * static_cast<Offset>(value);
  }

  void open(const std::vector<int>& devices) const noexcept override { open_devices(devices); }
  [[nodiscard]] DeviceRates measure(int device) const override { return measured_rates(device); }
  [[nodiscard]] std::unique_ptr<TallSpace> make_tall_space(Index rows, int device, Offset memory_bytes) const override {
    return cuda::make_tall_space(rows, device, memory_bytes);
  }
  [[nodiscard]] Offset free_bytes(int device) const override { return free_device_bytes(device); }

  [[nodiscard]] std::unique_ptr<Executor<double>> make_executor(const Job& job, Scalar<double>) const override {
    return make<double>(job);
  }
  [[nodiscard]] std::unique_ptr<Executor<float>> make_executor(const Job& job, Scalar<float>) const override {
    return make<float>(job);
  }
  [[nodiscard]] const out_of_core::Factory* out_of_core() const override { return &factory_; }

 private:
  template <class T>
  static std::unique_ptr<Executor<T>> make(const Job& job) {
    if (job.link != nullptr) return make_rank_executor<T>(job);
    CudaOptions options;
    options.device = job.devices.front();
    if (job.devices.size() > 1) options.devices = job.devices;
    options.memory_bytes = job.memory_bytes;
    options.timeline = job.timeline;
    options.pool = &job.pool;
    options.pair_sign = job.pair_sign;
    return make_cuda_executor<T>(job.plan, job.kind, job.rule, options);
  }

  out_of_core::FactoryOf<CudaOutOfCore> factory_;
};

}  // namespace

const Backend& backend() {
  static const CudaBackend the_backend;
  return the_backend;
}

}  // namespace espalier::device::cuda

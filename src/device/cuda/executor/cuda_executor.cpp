#include "device/cuda/executor/cuda_executor.hpp"

#include <algorithm>
#include <bit>
#include <future>

#include "base/beside.hpp"
#include "device/cuda/executor/executor_on_devices.hpp"
#include "device/cuda/executor/plan_values.hpp"
#include "device/cuda/kernels/factor/factor_kernel.cuh"
#include "device/cuda/runtime/device_guard.hpp"
#include "device/cuda/runtime/pinned_block.hpp"
#include "device/cuda/tables/needed_values.hpp"
#include "device/cuda/tables/pairs.hpp"

namespace espalier::device::cuda {

namespace {

Offset largest_stealable(const DevicePlan& tables) {
  Offset most = 0;
  for (auto r = static_cast<std::size_t>(tables.first_stealable); r < tables.regions.size(); ++r)
    most = std::max(most, tables.regions[r]);
  return most;
}

// Lets device a reach the memory of the others. A test that refuses one of these calls by its number finds no others
// between them, whichever thread is first. @returns whether it can
bool open_paths_from(int a, const std::vector<int>& devices) {
  int before = 0;
  bool all = cudaGetDevice(&before) == cudaSuccess && cudaSetDevice(a) == cudaSuccess;
  for (const int b : devices) {
    if (a == b || !all) continue;
    const auto e = attempt("cudaDeviceEnablePeerAccess", [&] { return cudaDeviceEnablePeerAccess(b, 0); });
    all = e == cudaSuccess || e == cudaErrorPeerAccessAlreadyEnabled;
  }
  (void)cudaGetLastError();
  (void)cudaSetDevice(before);
  return all;
}

// Whether every device reaches every other one's memory from now on; where one is refused, all go through the host. A
// path takes 1.5 ms: those of each device are opened beside the others'.
bool open_paths(const std::vector<int>& devices) {
  if (devices.size() == 1) return true;
  std::vector<std::future<bool>> opened;
  for (const int a : devices)
    opened.push_back(base::start_beside([a, &devices] { return open_paths_from(a, devices); }));
  bool all = true;
  for (auto& from : opened) all = from.get() && all;
  return all;
}

// How tasks are listed for these devices.
template <class T>
TaskOrder order_for(const std::vector<int>& devices) {
  TaskOrder order;
  order.two_columns = std::all_of(devices.begin(), devices.end(), [](int device) {
    const DeviceGuard guard(device);
    bool takes = false;
    call("task lists", [&] { return FactorKernel<T, Kind::llt>::takes_two_columns(takes); });
    return takes;
  });
  return order;
}

}  // namespace

template <class T>
ExecutorOnDevices<T>::ExecutorOnDevices(const plan::Plan& plan, Kind kind, const PivotRule& rule,
                                        const CudaOptions& options, DeviceArray<T> arena)
    : plan_(plan),
      kind_(kind),
      options_(options),
      devices_(options.devices.empty() ? std::vector<int>{options.device} : options.devices),
      peers_(!options.staging && open_paths(devices_)),
      tables_(make_device_plan(plan, kind, peers_, order_for<T>(devices_), options.pool)),
      context_{plan_,
               kind_,
               tables_,
               options.patience_seconds,
               largest_stealable(tables_),
               values_of(plan, options.pool),
               options.pool},
      arena_(std::move(arena)) {
  if (base::keeps_fp64<T> && stands_in_pairs(plan)) context_.pair_sign = options.pair_sign;
  if (static_cast<Index>(devices_.size()) != plan.ownership.devices)
    throw std::invalid_argument(fmt::format("make_cuda_executor: the plan is for {} devices, not for {}",
                                            plan.ownership.devices, devices_.size()));
  if (devices_.size() > kMostDevices)
    throw std::invalid_argument(fmt::format("make_cuda_executor: at most {} devices", kMostDevices));
  if (several() && !peers_) take_common();
  make_sides();
  for (const auto& side : sides_) at(*side, [&] { side->connect(addresses()); });
  moved_ = transferred_elements(plan_, kind_, tables_);
  set_up_tests();
  set_pivot_rule(rule);
  if (several()) take_needed_values();
  graphs_ = record_factorization({});
}

template <class T>
void ExecutorOnDevices<T>::take_common() {
  Offset places = 0;
  for (const auto space : tables_.place_space) places += space;
  const Offset parts = kind_ == Kind::lu ? 2 : 1;
  common_top_ = PinnedArray<T>(std::max<Offset>(1, tables_.regions[0]));
  common_places_ = PinnedArray<T>(std::max<Offset>(1, places));
  common_pivot_ = PinnedArray<T>(3 * static_cast<Offset>(plan_.tree.n));
  common_updates_ = PinnedArray<T>(std::max<Offset>(1, static_cast<Offset>(plan_.relative.size())) * kSlab);
  common_flag_ = PinnedArray<int>(parts * tables_.flags);
  common_ = {common_top_.data(), common_places_.data(), common_pivot_.data(), common_updates_.data(),
             common_flag_.data()};
}

// Calls use(number) for the sides from `first` on.
template <class T>
template <class Use>
void ExecutorOnDevices<T>::for_sides(int first, Use&& use) const {
  std::vector<std::future<void>> others;
  for (auto d = first + 1; d < static_cast<int>(devices_.size()); ++d)
    others.push_back(base::start_beside([&use, d] { use(d); }, options_.pool != nullptr && options_.pool->size() > 1));
  use(first);
  for (auto& other : others) other.get();
}

template <class T>
void ExecutorOnDevices<T>::make_sides() {
  sides_.resize(devices_.size());
  for_sides(0, [&](int self) { add_side(self); });
  // From GPU to GPU where they reach each other's memory.
  if (several() && peers_)
    for_sides(1, [&](int self) {
      Side& side = *sides_[static_cast<std::size_t>(self)];
      at(side, [&] { side.copy_tables(first()); });
    });
}

template <class T>
void ExecutorOnDevices<T>::add_side(int self) {
  const int device = devices_[static_cast<std::size_t>(self)];
  const DeviceGuard guard(device);
  try {
    const auto& budgets = options_.memory_bytes;
    const Offset budget = budgets.empty() ? 0 : budgets[static_cast<std::size_t>(self)];
    auto& side = sides_[static_cast<std::size_t>(self)];
    side = std::make_unique<Side>(context_, self, device, budget, common_,
                                  self == 0 ? std::move(arena_) : DeviceArray<T>());
    side->send_lists();
    if (self == 0 || !peers_) side->send_tables();
  } catch (const Error& e) {
    if (!several()) throw;
    throw Error(e.status().code, fmt::format("GPU {}: {}", device, e.what()));
  }
}

template <class T>
void ExecutorOnDevices<T>::set_up_tests() {
  for (const auto& side : sides_)
    at(*side, [&] {
      const auto d = static_cast<std::size_t>(side->self());
      if (d < options_.delays.size()) side->delay_tasks(options_.delays[d]);
      if (options_.timeline != nullptr) side->record_tasks();
    });
}

template <class T>
void ExecutorOnDevices<T>::take_needed_values() {
  if (peers_) {
    const auto needed = needed_values(plan_, tables_, context_.values, options_.pool);
    for (const auto& side : sides_)
      at(*side, [&] { side->take_chunks(needed[static_cast<std::size_t>(side->self())]); });
  }
  std::vector<unsigned char> owner(static_cast<std::size_t>(plan_.tree.n));
  for (Index f = 0; f < plan_.fronts(); ++f)
    std::fill(owner.begin() + plan_.tree.first[f], owner.begin() + plan_.tree.first[f + 1],
              static_cast<unsigned char>(std::countr_zero(tables_.fronts[f].members)));
  const auto bytes = static_cast<Offset>(owner.size());
  at(first(), [&] {
    owner_ = DeviceArray<unsigned char>(bytes, first().budget(), first().held() + bytes);
    first().copy_in(owner_.data(), owner.data(), bytes);
  });
}

template <class T>
auto ExecutorOnDevices<T>::record_factorization(const FilledValues& values) -> FactorGraphs {
  FactorGraphs graphs;
  for (const auto& side : sides_)
    at(*side, [&] {
      graphs.sides.push_back(Graph::record(side->stream().get(), [&] { enqueue_factorization(*side, values); }));
    });
  if (several())
    at(first(), [&] {
      graphs.judge =
          Graph::record(first().stream().get(), [&] { first().enqueue_judge(values, addresses(), owner_.data()); });
    });
  return graphs;
}

template <class T>
void ExecutorOnDevices<T>::enqueue_factorization(Side& side, const FilledValues& values) {
  if (!several()) {
    side.enqueue_begin(values);
    side.enqueue_factor();
    side.enqueue_judge(values, addresses(), nullptr);
    return;
  }
  if (peers_) side.enqueue_take(first(), values);
  side.enqueue_factor(side.self() == options_.fail_device);
  side.enqueue_counters();
}

template class ExecutorOnDevices<double>;
template class ExecutorOnDevices<float>;

Availability available_devices() {
  Availability a;
  int count = 0;
  const auto e = cudaGetDeviceCount(&count);
  if (e != cudaSuccess) {
    (void)cudaGetLastError();
    a.reason = std::string("no CUDA device: ") + cudaGetErrorString(e);
    return a;
  }
  int driver = 0;
  (void)cudaDriverGetVersion(&driver);
  for (int d = 0; d < count; ++d) {
    cudaDeviceProp p{};
    if (cudaGetDeviceProperties(&p, d) != cudaSuccess) continue;
    DeviceInfo info;
    info.name = p.name;
    info.driver = std::to_string(driver / 1000) + "." + std::to_string(driver % 1000 / 10);
    info.compute_major = p.major;
    info.compute_minor = p.minor;
    info.multiprocessors = p.multiProcessorCount;
    info.total_bytes = static_cast<Offset>(p.totalGlobalMem);
    a.devices.push_back(info);
  }
  if (a.devices.empty()) a.reason = "no CUDA device";
  return a;
}

void open_devices(const std::vector<int>& devices) noexcept {
  const auto open = [&](int device) noexcept {
    if (cudaSetDevice(device) == cudaSuccess && cudaFree(nullptr) == cudaSuccess) {
      for (const int other : devices)
        if (other != device) (void)cudaDeviceEnablePeerAccess(other, 0);
      SolveLaunches shape;
      (void)SolveKernel<double>::resident(shape);                 // loads these kernels
      if (device == devices.front()) PinnedBlock::keep_ready(2);  // for the tables of the first factorization
    }
    (void)cudaGetLastError();
  };
  try {
    std::vector<std::future<void>> opened;
    for (const int device : devices) opened.push_back(base::start_beside([&open, device] { open(device); }));
    for (auto& device : opened) device.get();
  } catch (const std::exception&) {  // no memory for the threads
  }
}

template <class T>
std::unique_ptr<CudaExecutor<T>> make_cuda_executor(const plan::Plan& plan, Kind kind, const PivotRule& rule,
                                                    const CudaOptions& options) {
  return std::make_unique<ExecutorOnDevices<T>>(plan, kind, rule, options);
}

template std::unique_ptr<CudaExecutor<double>> make_cuda_executor(const plan::Plan&, Kind, const PivotRule&,
                                                                  const CudaOptions&);
template std::unique_ptr<CudaExecutor<float>> make_cuda_executor(const plan::Plan&, Kind, const PivotRule&,
                                                                 const CudaOptions&);

}  // namespace espalier::device::cuda

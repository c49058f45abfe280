#include "solver/executor_choice.hpp"

#include <unistd.h>

#include <algorithm>
#include <utility>

#include "device/cuda/executor/cuda_executor.hpp"
#include "device/cuda/out_of_core/cuda_stream.hpp"
#include "device/host/host_executor.hpp"
#include "device/host/out_of_core/host_stream.hpp"
#include "out_of_core/executor.hpp"

namespace espalier::solver {

namespace {

// A buffer of the staging ring: 8 MiB hide the start of a copy; a small budget needs no more than a part of itself.
Offset slot_bytes(Offset budget) {
  constexpr Offset kMost = 8 << 20, kLeast = 64 << 10, kPage = 4096;
  return std::clamp(budget / 32 / kPage * kPage, kLeast, kMost);
}

out_of_core::StreamingOptions streaming_options(const std::vector<Offset>& budgets, const std::vector<double>& speed,
                                                int copy_threads) {
  out_of_core::StreamingOptions o;
  Offset least = budgets.front();
  for (std::size_t d = 0; d < budgets.size(); ++d) {
    o.devices.push_back({budgets[d], speed.empty() ? 1 : speed[d]});
    least = std::min(least, budgets[d]);
  }
  o.slot_bytes = slot_bytes(least);
  o.copy_threads = std::max(1, copy_threads);
  return o;
}

// What is page-locked is lost to all other programs: half of the machine's memory at most, unless more was asked for.
Offset pinned_bytes(Offset asked) {
  if (asked >= 0) return asked;
  return static_cast<Offset>(::sysconf(_SC_PHYS_PAGES)) * ::sysconf(_SC_PAGE_SIZE) / 2;
}

// Each device has its part of the threads.
template <class T>
std::unique_ptr<device::Executor<T>> stream_on_host(const plan::Plan& plan, const NumericOptions& options,
                                                    const device::PivotRule& rule, base::ThreadPool& pool,
                                                    base::MemoryBudget& budget) {
  const int devices = options.device.devices;
  std::vector<std::unique_ptr<out_of_core::StreamBackend<T>>> backends;
  for (int d = 0; d < devices; ++d) {
    device::host::HostStreamOptions host;
    host.device = d;
    host.devices = devices;
    if (devices > 1) host.threads = std::max(1, pool.size() / devices);
    backends.push_back(device::host::make_host_stream<T>(plan, options.kind, rule, pool, &budget, host));
  }
  std::vector<Offset> budgets = options.device_memory_bytes;
  for (Offset& b : budgets)  // no limit: all that the factorization could use
    if (b == 0) b = plan.memory.size * static_cast<Offset>(sizeof(T));
  out_of_core::StreamingOptions streaming = streaming_options(budgets, {}, 1);
  streaming.rates = out_of_core::StreamRates(plan.options.machine.out_of_core, options.kind);
  return out_of_core::make_streaming_executor<T>(std::move(backends), streaming, &budget);
}

// When others take memory in between, with less of it.
template <class T>
std::unique_ptr<device::Executor<T>> stream_on_gpus(const plan::Plan& plan, const NumericOptions& options,
                                                    const device::PivotRule& rule, base::ThreadPool& pool,
                                                    base::MemoryBudget& budget) {
  constexpr int kAttempts = 4;
  const std::vector<Offset>& wanted = options.device_memory_bytes;
  const auto gpus = static_cast<int>(wanted.size());
  for (int attempt = 1;; ++attempt) {
    std::vector<device::cuda::CudaStreamOptions> devices(wanted.size());
    std::vector<Offset> budgets;
    for (std::size_t d = 0; d < wanted.size(); ++d) {
      devices[d].device = options.device.gpus[d];
      Offset bytes = device::cuda::free_device_bytes(devices[d].device);
      if (wanted[d] > 0) bytes = std::min(bytes, wanted[d]);
      for (int k = 1; k < attempt; ++k) bytes -= bytes / 4;
      budgets.push_back(bytes);
    }
    try {
      out_of_core::StreamingOptions streaming =
          streaming_options(budgets, options.device.speed, pool.size() / (2 * gpus));
      streaming.pinned_bytes = pinned_bytes(options.pinned_memory_bytes);
      streaming.rates =
          out_of_core::StreamRates(plan.options.machine.out_of_core, options.kind, streaming.pinned_bytes > 0);
      return out_of_core::make_streaming_executor<T>(
          device::cuda::make_cuda_streams<T>(plan, options.kind, rule, pool, devices), streaming, &budget);
    } catch (const out_of_core::AllocationRefused&) {
      if (attempt == kAttempts) throw;
    }
  }
}

}  // namespace

template <class T>
std::unique_ptr<device::Executor<T>> make_executor(const plan::Plan& plan, const NumericOptions& options,
                                                   const device::PivotRule& rule, base::ThreadPool& pool,
                                                   base::MemoryBudget& budget, base::Timeline* timeline) {
  const bool on_host = options.device.backend == DeviceChoice::Backend::host;
  const auto& budgets = options.device_memory_bytes;
  const bool budgeted =
      options.device.budgeted && std::any_of(budgets.begin(), budgets.end(), [](Offset b) { return b > 0; });
  try {
    if (on_host) {
      device::host::HostOptions host;
      if (budgeted) host.device_memory_bytes = budgets;
      return device::host::make_host_executor<T>(plan, options.kind, rule, pool, &budget, timeline, std::move(host));
    }
    device::cuda::CudaOptions cuda;
    cuda.device = options.device.gpus.front();
    if (options.device.devices > 1) cuda.devices = options.device.gpus;
    cuda.memory_bytes = budgets;
    cuda.timeline = timeline;
    cuda.pool = &pool;
    return device::cuda::make_cuda_executor<T>(plan, options.kind, rule, cuda);
  } catch (const Error& e) {
    if (e.status().code != StatusCode::out_of_memory) throw;
    if (on_host && !budgeted) throw;
  }
  return on_host ? stream_on_host<T>(plan, options, rule, pool, budget)
                 : stream_on_gpus<T>(plan, options, rule, pool, budget);
}

template std::unique_ptr<device::Executor<double>> make_executor(const plan::Plan&, const NumericOptions&,
                                                                 const device::PivotRule&, base::ThreadPool&,
                                                                 base::MemoryBudget&, base::Timeline*);
template std::unique_ptr<device::Executor<float>> make_executor(const plan::Plan&, const NumericOptions&,
                                                                const device::PivotRule&, base::ThreadPool&,
                                                                base::MemoryBudget&, base::Timeline*);

}  // namespace espalier::solver

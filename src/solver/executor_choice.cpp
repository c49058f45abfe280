#include "solver/executor_choice.hpp"

#include <algorithm>
#include <utility>

#include "device/cuda/cuda_executor.hpp"
#include "device/cuda/cuda_stream.hpp"
#include "device/host/host_executor.hpp"
#include "device/host/host_stream.hpp"
#include "factor/streaming_executor.hpp"

namespace espalier::solver {

namespace {

// A buffer of the staging ring: 8 MiB hide the start of a copy; a small budget needs no more than a part of itself.
Offset slot_bytes(Offset budget) {
  constexpr Offset kMost = 8 << 20, kLeast = 64 << 10, kPage = 4096;
  return std::clamp(budget / 32 / kPage * kPage, kLeast, kMost);
}

factor::StreamingOptions streaming_options(Offset budget_bytes, int copy_threads) {
  factor::StreamingOptions o;
  o.budget_bytes = budget_bytes;
  o.slot_bytes = slot_bytes(budget_bytes);
  o.copy_threads = std::max(1, copy_threads);
  return o;
}

// Several host devices stream as one, with the threads and the memory of all.
template <class T>
std::unique_ptr<device::Executor<T>> stream_on_host(const analysis::Plan& plan, const NumericOptions& options,
                                                    const device::PivotRule& rule, base::ThreadPool& pool,
                                                    base::MemoryBudget& budget) {
  return factor::make_streaming_executor<T>(device::host::make_host_stream<T>(plan, options.kind, rule, pool, &budget),
                                            streaming_options(options.device_memory_bytes * options.device.devices, 1),
                                            &budget);
}

// When others take memory in between, with less of it.
template <class T>
std::unique_ptr<device::Executor<T>> stream_on_gpu(const analysis::Plan& plan, const NumericOptions& options,
                                                   const device::PivotRule& rule, base::ThreadPool& pool,
                                                   base::MemoryBudget& budget) {
  constexpr int kAttempts = 4;
  const int gpu = options.device.gpus.front();
  for (int attempt = 1;; ++attempt) {
    Offset bytes = device::cuda::free_device_bytes(gpu);
    if (options.device_memory_bytes > 0) bytes = std::min(bytes, options.device_memory_bytes);
    for (int k = 1; k < attempt; ++k) bytes -= bytes / 4;
    device::cuda::CudaStreamOptions gpu_options;
    gpu_options.device = gpu;
    try {
      return factor::make_streaming_executor<T>(
          device::cuda::make_cuda_stream<T>(plan, options.kind, rule, pool, gpu_options),
          streaming_options(bytes, pool.size() / 2), &budget);
    } catch (const device::AllocationRefused&) {
      if (attempt == kAttempts) throw;
    }
  }
}

}  // namespace

template <class T>
std::unique_ptr<device::Executor<T>> make_executor(const analysis::Plan& plan, const NumericOptions& options,
                                                   const device::PivotRule& rule, base::ThreadPool& pool,
                                                   base::MemoryBudget& budget, base::Timeline* timeline) {
  const bool on_host = options.device.backend == DeviceChoice::Backend::host;
  const bool budgeted = options.device_memory_bytes > 0 && options.device.budgeted;
  try {
    if (on_host) {
      device::host::HostOptions host;
      if (budgeted) host.device_memory_bytes = options.device_memory_bytes;
      return device::host::make_host_executor<T>(plan, options.kind, rule, pool, &budget, timeline, std::move(host));
    }
    device::cuda::CudaOptions cuda;
    cuda.device = options.device.gpus.front();
    if (options.device.devices > 1) cuda.devices = options.device.gpus;
    cuda.memory_bytes = options.device_memory_bytes;
    cuda.timeline = timeline;
    return device::cuda::make_cuda_executor<T>(plan, options.kind, rule, cuda);
  } catch (const Error& e) {
    if (e.status().code != StatusCode::out_of_memory) throw;
    if (on_host ? !budgeted : options.device.devices > 1) throw;
  }
  return on_host ? stream_on_host<T>(plan, options, rule, pool, budget)
                 : stream_on_gpu<T>(plan, options, rule, pool, budget);
}

template std::unique_ptr<device::Executor<double>> make_executor(const analysis::Plan&, const NumericOptions&,
                                                                 const device::PivotRule&, base::ThreadPool&,
                                                                 base::MemoryBudget&, base::Timeline*);
template std::unique_ptr<device::Executor<float>> make_executor(const analysis::Plan&, const NumericOptions&,
                                                                const device::PivotRule&, base::ThreadPool&,
                                                                base::MemoryBudget&, base::Timeline*);

}  // namespace espalier::solver

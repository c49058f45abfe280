/// \file
/// The body of the persistent factorization kernel; each factor_<kind>_<precision>.cu instantiates one variant.
// Every block takes the next task of the list until none is left. Tasks stand in a topological
// order and all blocks are resident, so the unfinished task with the lowest number can always proceed.
#pragma once

#include <algorithm>

#include "device/cuda/kernels/block_tasks.cuh"
#include "device/cuda/kernels/factor/factor_kernel.cuh"
#include "device/cuda/kernels/pivot_tasks.cuh"

namespace espalier::device::cuda {

namespace {

constexpr int kMostStages = 8;

template <class T, Kind K, bool Half, int Width>
__device__ __forceinline__ void run_block(Workshop<T>& w, const Front& f, const FactorTask& task, bool any) {
  if (uniform(rows_of(f, task).rows) <= 64)
    block_task<T, K, Half, Shape<T, 64, Width>>(w, f, task, any);
  else
    block_task<T, K, Half, Shape<T, 128, Width>>(w, f, task, any);
}

template <class T, Kind K, bool Wide, bool Half>
__global__ void __launch_bounds__(kThreads, Wide ? 2 : 3)
    factor_kernel(const __grid_constant__ FactorState<T> state, int first, int end, int stages, int n, int pair_sign) {
  extern __shared__ __align__(128) unsigned char area[];
  __shared__ std::uint64_t barriers[kMostStages];
  __shared__ TaskFeed feed;
  if (threadIdx.x == 0) {
    for (int b = 0; b < kMostStages; ++b) barrier_init(barriers + b);
    feed.first = first;
    feed.end = end;
    feed.waited = 0;
    feed.counter = state.control + (Wide ? kNextWide : kNextNarrow);
  }
  fence_shared();
  __syncthreads();
  Workshop<T> w{&state, {reinterpret_cast<T*>(area), barriers, stages, 0, &feed.waited}, &feed, n, T(pair_sign)};
  if (threadIdx.x < 32) {
    int id = 0;
    if (threadIdx.x == 0) id = first + atomicAdd(feed.counter, 1);
    load_task(w, __shfl_sync(0xffffffffu, id, 0));
  }
  std::uint64_t start = 0, begin = 0, waited = 0;
  int id = -1;
  for (;;) {
    __syncthreads();
    if (threadIdx.x == 0) {
      if (id < 0 || state.trace != nullptr) {
        const std::uint64_t now = global_nanoseconds();
        if (id < 0)
          start = now;
        else
          state.trace[id] = {begin, now, feed.waited, blockIdx.x};
        begin = now;
      }
      waited += feed.waited;
      feed.waited = 0;
      id = feed.id;
    }
    if (uniform(feed.stop)) {
      if (threadIdx.x == 0) {
        auto* sums = reinterpret_cast<unsigned long long*>(state.control);
        atomicAdd(sums + kBusy / 2, (global_nanoseconds() - start) / gridDim.x);
        atomicAdd(sums + kWaited / 2, waited / gridDim.x);
      }
      if (threadIdx.x == 0 && state.peers.count > 1 && aborted(state.control))
        for_each_device(state.peers.others((1u << state.peers.count) - 1),
                        [&](int d) { store_relaxed_devices(state.peers.control[d] + kAborted, 1); });
      return;
    }
    const FactorTask task = feed.task;
    const Front& front = feed.front;
    if (state.delay != 0 && threadIdx.x == 0) __nanosleep(state.delay);
    if (front.wait_begin < front.wait_end) wait_for_memory(state, front);
    const bool any = gather<T, K>(state, front, task, w.pipe.stages, feed.waited);
    if constexpr (Wide && Shape<T, 128, 64, 2>::kWarpgroup) {
      if (uniform(task.work == Work::two_columns)) {
        two_columns_task<T, K, 64>(w, front, task, any);
        continue;
      }
    }
    if (uniform(task.work != Work::block))
      pivot_task<T, K, Wide, Half>(w, front, task);
    else if (Wide && uniform(front.width) == 64)
      run_block<T, K, Half, Wide ? 64 : 32>(w, front, task, any);
    else
      run_block<T, K, Half, 32>(w, front, task, any);
  }
}

__device__ const int kMultipliesTogether = ESPALIER_WARPGROUP_PRODUCTS;

template <class T, Kind K, bool Half, class Use>
cudaError_t dispatch(bool wide, Use&& use) {
  return wide ? use(factor_kernel<T, K, true, Half>) : use(factor_kernel<T, K, false, Half>);
}

}  // namespace

template <class T, Kind K, bool Half>
cudaError_t FactorKernel<T, K, Half>::takes_two_columns(bool& takes) {
  int together = 0;
  const auto e = sizeof(T) == 4 ? cudaMemcpyFromSymbol(&together, kMultipliesTogether, sizeof(int)) : cudaSuccess;
  takes = together != 0;
  return e;
}

template <class T, Kind K, bool Half>
cudaError_t FactorKernel<T, K, Half>::shape_for(bool wide, std::size_t whole_elements, LaunchConfiguration& shape) {
  int device = 0, multiprocessors = 0, per_multiprocessor = 0, per_block = 0;
  if (const auto e = cudaGetDevice(&device)) return e;
  if (const auto e = cudaDeviceGetAttribute(&multiprocessors, cudaDevAttrMultiProcessorCount, device)) return e;
  if (const auto e = cudaDeviceGetAttribute(&per_multiprocessor, cudaDevAttrMaxSharedMemoryPerMultiprocessor, device))
    return e;
  if (const auto e = cudaDeviceGetAttribute(&per_block, cudaDevAttrMaxSharedMemoryPerBlockOptin, device)) return e;
  bool two_columns = false;
  if (const auto e = wide ? takes_two_columns(two_columns) : cudaSuccess) return e;
  const std::size_t width = wide ? 64 : 32;
  const std::size_t stage = (kRowBlock + width) * kChunk * sizeof(T);
  // The last product of a block task, assembly's scratch tile, a diagonal tile with its inverse, a whole front.
  std::size_t least = (kRowBlock * width + width * width) * sizeof(T);
  const std::size_t gathered = (kRowBlock + 4) * width * (two_columns ? 2 : 1);
  for (const std::size_t need : {gathered, 2 * width * (width + 4), whole_elements})
    least = std::max(least, need * sizeof(T));
  constexpr std::size_t kReserved = 2048;  // per block: what the system keeps, and the static part
  const std::size_t share = static_cast<std::size_t>(per_multiprocessor) / (wide ? 2 : 3) - kReserved;
  shape.stages = static_cast<int>(std::min<std::size_t>(kMostStages, std::max(share, least) / stage));
  const int most = (wide ? 4 : 3) * static_cast<int>(sizeof(double) / sizeof(T));
  if (shape.stages > most) shape.stages = most;
  if (sizeof(T) == 4) shape.stages -= shape.stages % static_cast<int>(width / kChunk);  // see sum_by_warpgroup()
  if (shape.stages < 1) shape.stages = 1;
  shape.shared_bytes = std::max(least, shape.stages * stage);
  constexpr int kStatic = 1024;
  if (shape.shared_bytes + kStatic > static_cast<std::size_t>(per_block)) return cudaErrorInvalidConfiguration;
  return dispatch<T, K, Half>(wide, [&](auto* kernel) {
    // The limit is the kernel's, not the executor's: another one with smaller fronts must not take it back.
    if (const auto e = cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, per_block - kStatic))
      return e;
    int each = 0;
    const auto e = cudaOccupancyMaxActiveBlocksPerMultiprocessor(&each, kernel, kThreads, shape.shared_bytes);
    shape.blocks = each * multiprocessors;
    return e != cudaSuccess ? e : (each == 0 ? cudaErrorInvalidConfiguration : cudaSuccess);
  });
}

template <class T, Kind K, bool Half>
cudaError_t FactorKernel<T, K, Half>::launch(bool wide, const LaunchConfiguration& shape, const FactorState<T>& state,
                                             int first, int end, int n, cudaStream_t stream, int pair_sign) {
  return dispatch<T, K, Half>(wide, [&](auto* kernel) {
    const int blocks = std::min(shape.blocks, end - first);
    kernel<<<blocks, kThreads, shape.shared_bytes, stream>>>(state, first, end, shape.stages, n, pair_sign);
    return cudaGetLastError();
  });
}

}  // namespace espalier::device::cuda

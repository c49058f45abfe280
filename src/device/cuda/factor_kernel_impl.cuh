/// \file
/// The body of the persistent factorization kernel; each factor_<kind>_<precision>.cu instantiates one variant.
// Every block takes the next task of the list until none is left. Tasks stand in a topological
// order and all blocks are resident, so the unfinished task with the lowest number can always proceed.
#pragma once

#include <algorithm>

#include "device/cuda/factor_kernel.cuh"
#include "device/cuda/factor_tasks.cuh"

namespace espalier::device::cuda {

namespace {

constexpr int kMostStages = 8;

template <class T, Kind K, int Width>
__device__ void run_tiled(Workshop<T>& w, const Front& f, const FactorTask& task) {
  if (task.work == Work::diagonal) {
    diagonal_task<T, K, Width>(w, f, task);
    return;
  }
  const int j = task.column;
  const int from = j < f.pivot_tiles ? f.column_end(j) : f.column_begin(j);
  const int row = max(f.block_begin(task.block), from);
  const int rows = f.block_end(task.block) - row;
  if (rows <= 64)
    block_task<T, K, Shape<64, Width>>(w, f, task, row, rows);
  else
    block_task<T, K, Shape<128, Width>>(w, f, task, row, rows);
}

template <class T, Kind K, bool Wide>
__global__ void __launch_bounds__(kThreads, Wide ? 2 : 3)
    factor_kernel(const __grid_constant__ FactorState<T> state, int first, int end, int stages, int n) {
  extern __shared__ __align__(128) unsigned char area[];
  __shared__ std::uint64_t barriers[kMostStages];
  __shared__ AssembleScratch scratch;
  __shared__ FactorTask next;
  __shared__ Front front;
  __shared__ int stop;
  if (threadIdx.x == 0)
    for (int b = 0; b < kMostStages; ++b) barrier_init(barriers + b);
  fence_copies();
  Workshop<T> w{&state, {reinterpret_cast<T*>(area), barriers, stages, 0}, &scratch, n};
  for (;;) {
    __syncthreads();
    if (threadIdx.x < 32) {
      int id = 0;
      if (threadIdx.x == 0) id = first + atomicAdd(state.control + (Wide ? kNextWide : kNextNarrow), 1);
      id = __shfl_sync(0xffffffffu, id, 0);
      const bool ends = id >= end || aborted(state.control);
      if (threadIdx.x == 0) stop = ends;
      if (!ends) {
        const FactorTask task = state.tasks[id];
        if (threadIdx.x == 0) next = task;
        const int* from = reinterpret_cast<const int*>(state.fronts + task.front);
        for (int x = threadIdx.x; x < static_cast<int>(sizeof(Front) / sizeof(int)); x += 32)
          reinterpret_cast<int*>(&front)[x] = from[x];
      }
    }
    __syncthreads();
    if (stop) return;
    const FactorTask task = next;
    if (front.wait_begin < front.wait_end) wait_for_memory(state, front);
    if (task.work == Work::whole) {
      whole_task<T, K>(w, front, task);
    } else if constexpr (Wide) {
      if (front.width == 64)
        run_tiled<T, K, 64>(w, front, task);
      else
        run_tiled<T, K, 32>(w, front, task);
    } else {
      run_tiled<T, K, 32>(w, front, task);
    }
  }
}

template <class T, Kind K, class Use>
cudaError_t dispatch(bool wide, Use&& use) {
  return wide ? use(factor_kernel<T, K, true>) : use(factor_kernel<T, K, false>);
}

}  // namespace

template <class T, Kind K>
cudaError_t FactorKernel<T, K>::shape_for(bool wide, std::size_t whole_elements, LaunchShape& shape) {
  int device = 0, multiprocessors = 0, per_multiprocessor = 0, per_block = 0;
  if (const auto e = cudaGetDevice(&device)) return e;
  if (const auto e = cudaDeviceGetAttribute(&multiprocessors, cudaDevAttrMultiProcessorCount, device)) return e;
  if (const auto e = cudaDeviceGetAttribute(&per_multiprocessor, cudaDevAttrMaxSharedMemoryPerMultiprocessor, device))
    return e;
  if (const auto e = cudaDeviceGetAttribute(&per_block, cudaDevAttrMaxSharedMemoryPerBlockOptin, device)) return e;
  const std::size_t width = wide ? 64 : 32;
  const std::size_t stage = (kRowBlock + width) * kChunk * sizeof(T);
  // The last product of a block task, assembly's scratch tile, a diagonal tile with its inverse, a whole front.
  std::size_t least = (kRowBlock * width + width * width) * sizeof(T);
  for (const std::size_t need : {(kRowBlock + 4) * width, 2 * width * (width + 4), whole_elements})
    least = std::max(least, need * sizeof(T));
  constexpr std::size_t kReserved = 2048;  // per block: what the system keeps, and the static part
  const std::size_t share = static_cast<std::size_t>(per_multiprocessor) / (wide ? 2 : 3) - kReserved;
  shape.stages = static_cast<int>(std::min<std::size_t>(kMostStages, std::max(share, least) / stage));
  if (shape.stages > (wide ? 4 : 3)) shape.stages = wide ? 4 : 3;
  if (shape.stages < 1) shape.stages = 1;
  shape.shared_bytes = std::max(least, shape.stages * stage);
  if (shape.shared_bytes + 1024 > static_cast<std::size_t>(per_block)) return cudaErrorInvalidConfiguration;
  return dispatch<T, K>(wide, [&](auto* kernel) {
    if (const auto e = cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize,
                                            static_cast<int>(shape.shared_bytes)))
      return e;
    int each = 0;
    const auto e = cudaOccupancyMaxActiveBlocksPerMultiprocessor(&each, kernel, kThreads, shape.shared_bytes);
    shape.blocks = each * multiprocessors;
    return e != cudaSuccess ? e : (each == 0 ? cudaErrorInvalidConfiguration : cudaSuccess);
  });
}

template <class T, Kind K>
cudaError_t FactorKernel<T, K>::launch(bool wide, const LaunchShape& shape, const FactorState<T>& state, int first,
                                       int end, int n, cudaStream_t stream) {
  return dispatch<T, K>(wide, [&](auto* kernel) {
    const int blocks = std::min(shape.blocks, end - first);
    kernel<<<blocks, kThreads, shape.shared_bytes, stream>>>(state, first, end, shape.stages, n);
    return cudaGetLastError();
  });
}

}  // namespace espalier::device::cuda

/// \file
/// The body of the persistent solve kernel. Every number of the factor is read once on the way up and once on the way
/// down, 16 bytes a lane, in the order in which it lies in memory.
#pragma once

#include <algorithm>

#include "device/cuda/solve_down.cuh"
#include "device/cuda/solve_up.cuh"

namespace espalier::device::cuda {

namespace {

/// Which fronts a kernel takes: small sub-trees on the way up, all others up and down, small sub-trees on the way down.
enum class Phase { small_up, large, small_down };

template <class T, int C, Phase P>
__global__ void __launch_bounds__(P == Phase::large ? kLargeThreads : kSmallThreads,
                                  P == Phase::large ? (C == 1 ? kLargePerMultiprocessor : kManyPerMultiprocessor)
                                                    : (C == 1 ? kSmallPerMultiprocessor : 3))
    solve_kernel(const __grid_constant__ SolveState<T> s, int first_column) {
  constexpr int kRows = P == Phase::small_up ? kSmallRows : kRowBlock;
  __shared__ SolveBench<T, C, kRows> b;
  const int first_up = P == Phase::large ? s.small_up : 0;
  const int ups = P == Phase::small_up ? s.small_up : (P == Phase::large ? s.up_tasks - s.small_up : 0);
  const int first_down = P == Phase::small_down ? s.down_tasks - s.small_down : 0;
  const int downs = P == Phase::small_down ? s.small_down : (P == Phase::large ? s.down_tasks - s.small_down : 0);
  for (;;) {
    __syncthreads();
    if (threadIdx.x == 0)
      b.next = load_relaxed(s.control + 1) != 0 ? ups + downs : atomicAdd(s.control + 2 + static_cast<int>(P), 1);
    __syncthreads();
    const int id = b.next;
    if (id >= ups + downs) {
      if (threadIdx.x == 0 && s.devices > 1 && load_relaxed(s.control + 1) != 0)
        for (int d = 0; d < s.devices; ++d) store_relaxed_devices(s.peer_control[d] + 1, 1);
      return;
    }
    const SolveTask task = id < ups ? s.up[first_up + id] : s.down[first_down + id - ups];
    const int* from = reinterpret_cast<const int*>(s.fronts + task.front);
    for (int x = threadIdx.x; x < static_cast<int>(sizeof(Front) / sizeof(int)); x += threads())
      reinterpret_cast<int*>(&b.front)[x] = from[x];
    __syncthreads();
    if constexpr (P == Phase::small_up)
      go_up<T, C, kRows>(s, b, -1, first_column);
    else if (P == Phase::large && id < ups)
      go_up<T, C, kRows>(s, b, task.block, first_column);
    else
      go_down<T, C, kRows>(s, b, task.block, first_column);
  }
}

template <class T>
__global__ void copy_kernel(T* to, const T* from, std::int64_t count) {
  const std::int64_t step = static_cast<std::int64_t>(gridDim.x) * blockDim.x;
  for (std::int64_t x = static_cast<std::int64_t>(blockIdx.x) * blockDim.x + threadIdx.x; x < count; x += step)
    to[x] = from[x];
}

template <class T, int C, class Use>
cudaError_t for_each_phase(const Use& use) {
  if (const auto e = use(solve_kernel<T, C, Phase::small_up>, 0, kSmallThreads)) return e;
  if (const auto e = use(solve_kernel<T, C, Phase::large>, 1, kLargeThreads)) return e;
  return use(solve_kernel<T, C, Phase::small_down>, 2, kSmallThreads);
}

}  // namespace

template <class T>
cudaError_t SolveKernel<T>::resident(bool many, SolveShape& shape) {
  int device = 0, multiprocessors = 0;
  if (const auto e = cudaGetDevice(&device)) return e;
  if (const auto e = cudaDeviceGetAttribute(&multiprocessors, cudaDevAttrMultiProcessorCount, device)) return e;
  const auto ask = [&](auto* kernel, int phase, int block) {
    int each = 0;
    const auto e = cudaOccupancyMaxActiveBlocksPerMultiprocessor(&each, kernel, block, 0);
    shape.blocks[phase] = each * multiprocessors;
    return e;
  };
  return many ? for_each_phase<T, kManyColumns>(ask) : for_each_phase<T, 1>(ask);
}

template <class T>
cudaError_t launch_copy(T* to, const T* from, std::int64_t count, cudaStream_t stream) {
  constexpr int kBlock = 512;
  const auto blocks = std::min<std::int64_t>((count + kBlock - 1) / kBlock, 528);
  if (count > 0) copy_kernel<<<static_cast<int>(blocks), kBlock, 0, stream>>>(to, from, count);
  return cudaGetLastError();
}

template <class T>
cudaError_t SolveKernel<T>::launch(bool many, const SolveShape& shape, const SolveState<T>& state, int first_column,
                                   cudaStream_t stream) {
  const int tasks[3] = {state.small_up, state.up_tasks - state.small_up + state.down_tasks - state.small_down,
                        state.small_down};
  const auto start = [&](auto* kernel, int phase, int block) {
    if (tasks[phase] == 0) return cudaSuccess;
    kernel<<<std::min(shape.blocks[phase], tasks[phase]), block, 0, stream>>>(state, first_column);
    return cudaGetLastError();
  };
  return many ? for_each_phase<T, kManyColumns>(start) : for_each_phase<T, 1>(start);
}

}  // namespace espalier::device::cuda

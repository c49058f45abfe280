/// \file
/// The body of the persistent solve kernel. Every number of the factor is read once on the way up and once on the way
/// down, 16 bytes a lane, in the order in which it lies in memory.
#pragma once

#include <algorithm>
#include <type_traits>

#include "device/cuda/kernels/solve/solve_down_slabs.cuh"
#include "device/cuda/kernels/solve/solve_up.cuh"
#include "device/cuda/kernels/solve/solve_up_slabs.cuh"

namespace espalier::device::cuda {

namespace {

/// Which fronts a kernel takes: small sub-trees on the way up, all others up and down, small sub-trees on the way down.
enum class Phase { small_up, large, small_down };

constexpr int threads_of(Phase p) { return p == Phase::large ? kLargeThreads : kSmallThreads; }
constexpr int rows_of(Phase p) { return p == Phase::small_up ? kSmallRows : kRowBlock; }

template <class T, int C, Phase P>
using BenchOf = std::conditional_t<C == 1, SolveBench<T, rows_of(P), P == Phase::large>,
                                   SlabBench<T, C, rows_of(P), threads_of(P)>>;

/// Bytes of shared memory before the room for the diagonal part of a block.
template <class T, int C, Phase P>
constexpr int kBenchBytes = (sizeof(BenchOf<T, C, P>) + 127) / 128 * 128;
/// Bytes of that room: only one right-hand side, for which chains of blocks are all that counts, has it.
template <class T, int C, Phase P>
constexpr int kKeptBytes = C == 1 && P == Phase::large ? kKeptElements* static_cast<int>(sizeof(T)) : 0;

constexpr int per_multiprocessor(Phase p, int columns) {
  if (p == Phase::large) return kLargePerMultiprocessor;
  return columns == 1 ? kSmallPerMultiprocessor : kSlabsPerMultiprocessor;
}

/// The tasks of a phase: the last ones are of the way down.
template <Phase P>
struct TasksOf {
  int first_up, ups, first_down, downs;

  template <class T>
  __host__ __device__ explicit TasksOf(const SolveState<T>& s)
      : first_up(P == Phase::large ? s.small_up : 0),
        ups(P == Phase::small_up ? s.small_up : (P == Phase::large ? s.up_tasks - s.small_up : 0)),
        first_down(P == Phase::small_down ? s.down_tasks - s.small_down : 0),
        downs(P == Phase::small_down ? s.small_down : (P == Phase::large ? s.down_tasks - s.small_down : 0)) {}
};

/// A task is taken once for every C columns of the pass, one after another, so that they read the factor together.
/// keep: there is room for the diagonal part of a block.
template <class T, int C, Phase P>
__global__ void __launch_bounds__(threads_of(P), per_multiprocessor(P, C))
    solve_kernel(const __grid_constant__ SolveState<T> s, bool keep) {
  extern __shared__ __align__(128) unsigned char shared[];
  auto& b = *reinterpret_cast<BenchOf<T, C, P>*>(shared);
  const TasksOf<P> tasks(s);
  const int strips = C == 1 ? 1 : s.pass / C, end = (tasks.ups + tasks.downs) * strips;
  unsigned parity = 0;
  if constexpr (C == 1) {
    if (threadIdx.x == 0) {
      b.keeps = keep;
      if (keep) barrier_init(&b.kept_barrier);
      fence_shared();
    }
  }
  for (;;) {
    __syncthreads();
    if (threadIdx.x == 0) {
      const int id = load_relaxed(s.control + 1) != 0 ? end : atomicAdd(s.control + 2 + static_cast<int>(P), 1);
      b.next = min(id, end) / strips;
      if constexpr (C > 1) b.first = id % strips * C;
    }
    __syncthreads();
    const int id = b.next;
    if (id >= tasks.ups + tasks.downs) {
      if (threadIdx.x == 0 && s.devices > 1 && load_relaxed(s.control + 1) != 0)
        for (int d = 0; d < s.devices; ++d) store_relaxed_devices(s.peer_control[d] + 1, 1);
      return;
    }
    const SolveTask task = id < tasks.ups ? s.up[tasks.first_up + id] : s.down[tasks.first_down + id - tasks.ups];
    const int* from = reinterpret_cast<const int*>(s.fronts + task.front);
    for (int x = threadIdx.x; x < static_cast<int>(sizeof(Front) / sizeof(int)); x += threads())
      reinterpret_cast<int*>(&b.front)[x] = from[x];
    __syncthreads();
    const bool up = P == Phase::small_up || (P == Phase::large && id < tasks.ups);
    const int block = P == Phase::small_up ? -1 : task.block;
    if constexpr (P != Phase::small_down) {
      if (up) {
        if constexpr (C == 1)
          go_up(s, b, block, parity);
        else
          go_up(s, b, block);
        continue;
      }
    }
    if constexpr (P != Phase::small_up) {
      if constexpr (C == 1)
        go_down<(P == Phase::large ? 8 : 4)>(s, b, block, parity);
      else
        go_down(s, b, block);
    }
  }
}

template <class T>
__global__ void copy_kernel(T* to, const T* from, std::int64_t count) {
  const std::int64_t step = static_cast<std::int64_t>(gridDim.x) * blockDim.x;
  for (std::int64_t x = static_cast<std::int64_t>(blockIdx.x) * blockDim.x + threadIdx.x; x < count; x += step)
    to[x] = from[x];
}

cudaError_t attribute(cudaDeviceAttr which, int& value) {
  int device = 0;
  if (const auto e = cudaGetDevice(&device)) return e;
  return cudaDeviceGetAttribute(&value, which, device);
}

template <class T, int C, Phase P>
cudaError_t ask_resident(int& blocks, int& bytes) {
  int multiprocessors = 0, most = 0, major = 0, each = 0;
  if (const auto e = attribute(cudaDevAttrMultiProcessorCount, multiprocessors)) return e;
  if (const auto e = attribute(cudaDevAttrMaxSharedMemoryPerBlockOptin, most)) return e;
  if (const auto e = attribute(cudaDevAttrComputeCapabilityMajor, major)) return e;
  constexpr int kAll = kBenchBytes<T, C, P> + kKeptBytes<T, C, P>;
  bytes = major >= 9 && kAll <= most ? kAll : kBenchBytes<T, C, P>;  // bulk copies fill that room
  const auto kernel = solve_kernel<T, C, P>;
  if (const auto e = cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, bytes)) return e;
  const auto e = cudaOccupancyMaxActiveBlocksPerMultiprocessor(&each, kernel, threads_of(P), bytes);
  blocks = each * multiprocessors;
  return e;
}

template <class T, int C, Phase P>
cudaError_t start(int blocks, int bytes, const SolveState<T>& s, cudaStream_t stream) {
  const TasksOf<P> tasks(s);
  const int count = (tasks.ups + tasks.downs) * (s.pass / C);
  if (count == 0) return cudaSuccess;
  const bool keep = bytes > kBenchBytes<T, C, P>;
  solve_kernel<T, C, P><<<std::min(blocks, count), threads_of(P), bytes, stream>>>(s, keep);
  return cudaGetLastError();
}

/// use(constant of the phase, its number)
template <class Use>
cudaError_t for_each_phase(Use&& use) {
  if (const auto e = use(std::integral_constant<Phase, Phase::small_up>{}, 0)) return e;
  if (const auto e = use(std::integral_constant<Phase, Phase::large>{}, 1)) return e;
  return use(std::integral_constant<Phase, Phase::small_down>{}, 2);
}

}  // namespace

template <class T>
cudaError_t SolveKernel<T>::resident(SolveLaunches& shape) {
  return for_each_phase([&](auto phase, int p) {
    constexpr Phase kPhase = decltype(phase)::value;
    if (const auto e = ask_resident<T, 1, kPhase>(shape.blocks[0][p], shape.bytes[0][p])) return e;
    if (const auto e = ask_resident<T, kSlab, kPhase>(shape.blocks[1][p], shape.bytes[1][p])) return e;
    if constexpr (kPhase != Phase::large) return cudaSuccess;
    return ask_resident<T, 2 * kSlab, Phase::large>(shape.blocks[2][p], shape.bytes[2][p]);
  });
}

template <class T>
cudaError_t launch_copy(T* to, const T* from, std::int64_t count, cudaStream_t stream) {
  constexpr int kBlock = 512;
  const auto blocks = std::min<std::int64_t>((count + kBlock - 1) / kBlock, 528);
  if (count > 0) copy_kernel<<<static_cast<int>(blocks), kBlock, 0, stream>>>(to, from, count);
  return cudaGetLastError();
}

template <class T>
cudaError_t SolveKernel<T>::launch(const SolveLaunches& shape, const SolveState<T>& s, cudaStream_t stream) {
  return for_each_phase([&](auto phase, int p) {
    constexpr Phase kPhase = decltype(phase)::value;
    if (s.pass == 1) return start<T, 1, kPhase>(shape.blocks[0][p], shape.bytes[0][p], s, stream);
    if (kPhase == Phase::large && s.pass % (2 * kSlab) == 0)
      return start<T, 2 * kSlab, Phase::large>(shape.blocks[2][p], shape.bytes[2][p], s, stream);
    return start<T, kSlab, kPhase>(shape.blocks[1][p], shape.bytes[1][p], s, stream);
  });
}

}  // namespace espalier::device::cuda

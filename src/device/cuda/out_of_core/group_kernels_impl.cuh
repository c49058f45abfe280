/// \file
/// The bodies of the group kernels; group_kernels_<precision>.cu instantiate them.
#pragma once

#include <algorithm>

#include "device/cuda/kernels/block_tasks.cuh"
#include "device/cuda/kernels/pivot_tasks.cuh"
#include "device/cuda/kernels/place.cuh"
#include "device/cuda/out_of_core/group_kernels.cuh"

namespace espalier::device::cuda {

namespace {

constexpr int kGroupStages = 4;

/// This block's task and the front, in shared memory.
template <class T>
__device__ inline FactorTask begin_task(const FactorState<T>& s, int first, Front& f) {
  const int* from = reinterpret_cast<const int*>(s.fronts + 1);
  for (int x = threadIdx.x; x < static_cast<int>(sizeof(Front) / sizeof(int)); x += kThreads)
    reinterpret_cast<int*>(&f)[x] = from[x];
  __syncthreads();
  return s.tasks[first + static_cast<int>(blockIdx.x)];
}

/// A child's contribution out of core lies contiguously.
template <class T>
__device__ inline void add_columns(const FactorState<T>& s, const Front& f, const Target<T>& x, const Overlap& overlap,
                                   const T* from, bool transposed, bool strict) {
  add_overlap(s, f, x, overlap, from, static_cast<T* const*>(nullptr), transposed, strict);
}

template <class T, Kind K>
__global__ void __launch_bounds__(kThreads)
    group_add(const __grid_constant__ FactorState<T> s, int first, const __grid_constant__ AddedColumns<T> part) {
  extern __shared__ __align__(128) unsigned char area[];
  __shared__ Front f;
  const FactorTask task = begin_task(s, first, f);
  T* tile = reinterpret_cast<T*>(area);
  const Target<T> x = target_of<T, K>(f, task, tile);
  Overlap overlap{};
  if (part.link < 0) {
    if (task.column >= f.pivot_tiles) return;
  } else {
    const ChildRows link = s.links[part.link];
    const std::int32_t* b = s.bounds + link.bound;
    overlap.child = link.child;
    overlap.c0 = max(b[x.tile_col], part.begin);
    overlap.c1 = min(b[x.tile_col_end], part.end);
    overlap.r0 = max(b[x.tile_row], overlap.c0);
    overlap.r1 = b[x.tile_row_end];
    if (overlap.c0 >= overlap.c1 || overlap.r0 >= overlap.r1) return;
  }
  zero_area(tile, x.ld * f.width);
  __syncthreads();
  if (part.link < 0) {
    for (int i = x.tile_row; i < x.tile_row_end; ++i) add_entries_of_tile(s, f, x, i, x.tile_col);
  } else {
    const bool lu = K == Kind::lu;
    if (!lu || x.square || x.part == 0) add_columns(s, f, x, overlap, part.lower, false, false);
    if (lu && (x.square || x.part == 1)) {
      __syncthreads();
      add_columns(s, f, x, overlap, part.upper, x.square, true);
    }
  }
  __syncthreads();
  const RowRange at = rows_of_tile(f, task);
  add_to_place(place_of_tile(s.base[f.region], f, task, at.row, at.rows), tile, x.ld);
}

/// Where chunk q of a slab begins at padded row `row`.
template <class T>
__device__ inline std::int64_t slab_offset(const SlabColumns<T>& p, const Front& f, int q, int row) {
  if (p.row >= 0)
    return static_cast<std::int64_t>(q) * (f.total_pad - p.row) * kChunk +
           static_cast<std::int64_t>(row - p.row) * kChunk;
  const int per_tile = f.width / kChunk, j = p.begin + q / per_tile;
  return f.column_offset(j) - f.column_offset(p.begin) +
         static_cast<std::int64_t>(q % per_tile) * (f.total_pad - j * f.width) * kChunk +
         static_cast<std::int64_t>(row - j * f.width) * kChunk;
}

/// acc += sum over all chunks of the slab of A_q B_q^T; everything is there.
template <class T, class S>
__device__ void slab_products(Accumulator<T, S>& acc, const Front& f, const SlabColumns<T>& p, const Operand<T>& a,
                              const Operand<T>& b, int chunks, Pipeline<T>& pipe, HalfScales scales) {
  const Corner<S> at;
  const bool active = at.row < a.rows && at.col < b.rows;
  Products<T, SplitFormat::half, S> products(acc, scales);
#if ESPALIER_BULK_COPIES
  const auto issue = [&](int q) {
    const int stage = q % pipe.depth;
    std::uint64_t* bar = pipe.barriers + stage;
    T* to = pipe.stages + stage * S::kStage;
    const unsigned bytes_a = a.rows * kChunk * sizeof(T), bytes_b = b.rows * kChunk * sizeof(T);
    barrier_expect(bar, bytes_a + bytes_b);
    bulk_copy(to, a.base + slab_offset(p, f, q, a.row), bytes_a, bar);
    bulk_copy(to + S::kRows * kChunk, b.base + slab_offset(p, f, q, b.row), bytes_b, bar);
  };
  if (threadIdx.x == 0)
    for (int q = 0; q < min(chunks, pipe.depth - 1); ++q) issue(q);
  for (int q = 0; q < chunks; ++q) {
    // The stage that chunk q + depth - 1 takes was read before the barrier that ended chunk q - 1.
    if (threadIdx.x == 0 && q + pipe.depth - 1 < chunks) issue(q + pipe.depth - 1);
    pipe.wait(q % pipe.depth);
    const T* left = pipe.stages + q % pipe.depth * S::kStage;
    if (active) products.add(left, left + S::kRows * kChunk, at);
    __syncthreads();
  }
#else
  for (int q = 0; q < chunks; ++q) {
    const T* from_a = a.base + slab_offset(p, f, q, a.row);
    const T* from_b = b.base + slab_offset(p, f, q, b.row);
    for (int x = threadIdx.x; x < a.rows * kChunk; x += kThreads) pipe.stages[x] = from_a[x];
    for (int x = threadIdx.x; x < b.rows * kChunk; x += kThreads) pipe.stages[S::kRows * kChunk + x] = from_b[x];
    __syncthreads();
    if (active) products.add(pipe.stages, pipe.stages + S::kRows * kChunk, at);
    __syncthreads();
  }
#endif
  products.finish();
}

template <class T, Kind K, int Width>
__global__ void __launch_bounds__(kThreads, 2)
    group_update(const __grid_constant__ FactorState<T> s, int first, const __grid_constant__ SlabColumns<T> p) {
  using S = Shape<T, 128, Width>;
  extern __shared__ __align__(128) unsigned char area[];
  __shared__ std::uint64_t barriers[kGroupStages];
  __shared__ Front f;
  if (threadIdx.x == 0)
    for (int b = 0; b < kGroupStages; ++b) barrier_init(barriers + b);
  fence_shared();
  const FactorTask task = begin_task(s, first, f);
  const RowRange at = rows_of_tile(f, task);
  const int j = task.column, col = f.column_begin(j), cols = f.column_end(j) - col;
  Pipeline<T> pipe{reinterpret_cast<T*>(area), barriers, kGroupStages, 0};
  T acc[S::kM][S::kN][4] = {};
  const Operand<T> left{p.part[operand_array<K>(task.part, 0)], at.row, at.rows};
  const Operand<T> right{p.part[operand_array<K>(task.part, 1)], col, cols};
  const int chunks = (f.column_end(p.end - 1) - f.column_begin(p.begin)) / kChunk;
  slab_products<T, S>(acc, f, p, left, right, chunks, pipe, operand_scales<K>(s.largest(), s.growth(), task.part));
  const Corner<S> corner;
  T* tile = pipe.stages;
  for_each_element<S>(corner, [&](int m, int n, int e, int r, int c) { tile[c * S::kLd + r] = -acc[m][n][e]; });
  __syncthreads();
  add_to_place(place_of_tile(s.base[f.region], f, task, at.row, at.rows), tile, S::kLd);
}

template <class T>
constexpr std::size_t add_bytes() {
  return (kRowBlock + 4) * 64 * sizeof(T);
}
template <class T, int Width>
constexpr std::size_t update_bytes() {
  return std::max<std::size_t>(kGroupStages * Shape<T, 128, Width>::kStage, Shape<T, 128, Width>::kLd * Width) *
         sizeof(T);
}

}  // namespace

template <class T, Kind K>
cudaError_t GroupKernels<T, K>::prepare() {
  const auto allow = [](auto* kernel, std::size_t bytes) {
    return cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, static_cast<int>(bytes));
  };
  if (const auto e = allow(group_add<T, K>, add_bytes<T>())) return e;
  if (const auto e = allow(group_update<T, K, 64>, update_bytes<T, 64>())) return e;
  return allow(group_update<T, K, 32>, update_bytes<T, 32>());
}

template <class T, Kind K>
cudaError_t GroupKernels<T, K>::add(const FactorState<T>& state, int first, int end, const AddedColumns<T>& part,
                                    cudaStream_t stream) {
  if (first == end) return cudaSuccess;
  group_add<T, K><<<end - first, kThreads, add_bytes<T>(), stream>>>(state, first, part);
  return cudaGetLastError();
}

template <class T, Kind K>
cudaError_t GroupKernels<T, K>::update(const FactorState<T>& state, int width, int first, int end,
                                       const SlabColumns<T>& slab, cudaStream_t stream) {
  if (first == end || slab.begin == slab.end) return cudaSuccess;
  if (width == 64)
    group_update<T, K, 64><<<end - first, kThreads, update_bytes<T, 64>(), stream>>>(state, first, slab);
  else
    group_update<T, K, 32><<<end - first, kThreads, update_bytes<T, 32>(), stream>>>(state, first, slab);
  return cudaGetLastError();
}

}  // namespace espalier::device::cuda

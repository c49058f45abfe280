/// \file
/// Sums of products of finished blocks.
#pragma once

#include "device/cuda/kernels/warpgroup_products.cuh"

namespace espalier::device::cuda {

/// acc += sum over its chunks of A_q B_q^T, each as soon as the flags of its tile column are set. By all threads; ends
/// with a barrier.
template <class T, class S>
__device__ __forceinline__ void sum_products(Accumulator<T, S>& acc, const ChunkSum<T>& sum, Pipeline<T>& pipe,
                                             int* control, std::uint64_t patience, HalfScales scales) {
  [[maybe_unused]] const Corner<S> at;
#if ESPALIER_BULK_COPIES
  ChunkLoader<T, S> loader(sum, pipe, control, patience);
  if constexpr (S::kWarpgroup) {
    sum_by_warpgroup<S>(acc, sum, loader, pipe, scales);
  } else {
    Products<T, SplitFormat::half, S> products(acc, scales);
    const bool active = at.row < sum.a.rows && at.col < sum.b.rows;
    for (int q = 0, stage = 0; q < sum.chunks; ++q) {
      if (threadIdx.x < 32) loader.issue(q, q);
      __syncwarp();
      pipe.wait(stage);
      const T* left = pipe.stages + stage * S::kStage;
      if (active) products.add(left, sum.same ? left : left + S::kRows * kChunk, at);
      stage = stage + 1 == pipe.depth ? 0 : stage + 1;
      __syncthreads();
    }
    products.finish();
  }
#else
  Products<T, SplitFormat::half, S> products(acc, scales);
  const bool active = at.row < sum.a.rows && at.col < sum.b.rows;
  constexpr int kPerTile = S::kWidth / kChunk;
  for (int q = 0; q < sum.chunks; ++q) {
    if (q % kPerTile == 0 && threadIdx.x < 2) {
      const std::int64_t k = static_cast<std::int64_t>(q / kPerTile) * sum.flag_stride;
      wait_for((threadIdx.x == 0 ? sum.flag_a : sum.flag_b) + k, 1, control, patience);
    }
    __syncthreads();
    const T* from_a = sum.a.base + sum.front->chunk_offset(sum.first + q, sum.a.row);
    const T* from_b = sum.b.base + sum.front->chunk_offset(sum.first + q, sum.b.row);
    T* left = pipe.stages;
    T* right = left + S::kRows * kChunk;
    for (int x = threadIdx.x; x < sum.a.rows * kChunk; x += kThreads) left[x] = from_a[x];
    for (int x = threadIdx.x; x < sum.b.rows * kChunk; x += kThreads) right[x] = from_b[x];
    __syncthreads();
    if (active) products.add(left, right, at);
    __syncthreads();
  }
  products.finish();
#endif
}

}  // namespace espalier::device::cuda

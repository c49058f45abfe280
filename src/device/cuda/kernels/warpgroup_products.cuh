/// \file
/// Products of FP32 factors as in split_products.cuh, by the four warps of a block together: the tensor cores of sm_90a
/// take the FP16 parts of A from registers and those of B from shared memory. A row of A belongs to one warp, which
/// splits it on its way to the registers; with A in shared memory, it would be written and read back three times, and
/// the traffic there would be half as much again.
///
/// A panel of B, 8 rows and 16 columns of floats, is split where it lies. Its 512 bytes then hold four matrices of
/// 8 x 8 numbers in FP16: the high parts of columns 0, 4, 1, 5, 2, 6, 3, 7, those of the other eight columns in the
/// same order, and the low parts likewise. The order of columns does not matter, since it is the same in A.
#pragma once

#include "device/cuda/kernels/pipeline.cuh"
#include "device/cuda/kernels/split_products.cuh"

namespace espalier::device::cuda {

#if ESPALIER_WARPGROUP_PRODUCTS

/// Splits `Rows` rows of chunks that stand `stride` apart, in place or to another one, those that hold nothing, too:
/// branches would cost more. By all warps; a panel has one warp, of which a lane has four neighbouring numbers.
template <int Rows, int Chunks>
__device__ __forceinline__ void split_rows(const float* from, float* chunk, int stride, float scale) {
  constexpr int kPanels = Rows / kPanel / (kThreads / 32);
  const int warp = static_cast<int>(threadIdx.x) >> 5, lane = static_cast<int>(threadIdx.x) & 31;
  float4 x[Chunks][kPanels];
#pragma unroll
  for (int q = 0; q < Chunks; ++q)
#pragma unroll
    for (int k = 0; k < kPanels; ++k)
      x[q][k] = reinterpret_cast<const float4*>(from + q * stride + (warp * kPanels + k) * 128)[lane];
  __syncwarp();
#pragma unroll
  for (int q = 0; q < Chunks; ++q)
#pragma unroll
    for (int k = 0; k < kPanels; ++k) {
      SplitPanel<SplitFormat::half> parts;
      parts.take(0, {x[q][k].x, x[q][k].y}, scale);
      parts.take(1, {x[q][k].z, x[q][k].w}, scale);
      auto* to = reinterpret_cast<uint2*>(chunk + q * stride + (warp * kPanels + k) * 128) + lane;
      to[0] = {parts.high[0], parts.high[1]};
      to[32] = {parts.low[0], parts.low[1]};
    }
}

/// Describes the high (0) or low (1) parts of 64 (or fewer) rows and 16 columns in shared memory to the tensor cores:
/// matrices of 8 x 8 are 128 bytes apart along the columns and 512 along the rows.
__device__ inline std::uint64_t describe(const float* rows, int part) {
  const std::uint64_t address = shared_address(rows) + 256u * static_cast<unsigned>(part);
  return (address & 0x3ffff) >> 4 | std::uint64_t{128 >> 4} << 16 | std::uint64_t{512 >> 4} << 32;
}

/// One part of 16 rows and 16 columns of A in a warp's registers, as the tensor cores take it.
struct RowsOfA {
  unsigned top[2], bottom[2];  ///< panels of rows 0 to 7 and 8 to 15
};

/// d (64 x 8 N, 16 rows of each warp) += A B^T, or without `add` d = A B^T; may be under way on return.
#define ESPALIER_SUMS(n) "+f"(d[n][0]), "+f"(d[n][1]), "+f"(d[n][2]), "+f"(d[n][3])
#define ESPALIER_FOUR_SUMS(n) ESPALIER_SUMS(n), ESPALIER_SUMS(n + 1), ESPALIER_SUMS(n + 2), ESPALIER_SUMS(n + 3)
#define ESPALIER_ROWS_OF_A "r"(a.top[0]), "r"(a.bottom[0]), "r"(a.top[1]), "r"(a.bottom[1])
__device__ __forceinline__ void multiply_together(float (&d)[16][4], const RowsOfA& a, std::uint64_t b, int add) {
  asm volatile(
      "{\n.reg .pred add;\nsetp.ne.b32 add,%69,0;\n"
      "wgmma.mma_async.sync.aligned.m64n128k16.f32.f16.f16 "
      "{%0,%1,%2,%3,%4,%5,%6,%7,%8,%9,%10,%11,%12,%13,%14,%15,%16,%17,%18,%19,%20,%21,%22,%23,%24,%25,%26,%27,%28,%29,%"
      "30,%31,%32,%33,%34,%35,%36,%37,%38,%39,%40,%41,%42,%43,%44,%45,%46,%47,%48,%49,%50,%51,%52,%53,%54,%55,%56,%57,%"
      "58,%59,%60,%61,%62,%63},{%64,%65,%66,%67},%68,add,1,1,0;\n}"
      : ESPALIER_FOUR_SUMS(0), ESPALIER_FOUR_SUMS(4), ESPALIER_FOUR_SUMS(8), ESPALIER_FOUR_SUMS(12)
      : ESPALIER_ROWS_OF_A, "l"(b), "r"(add));
}
__device__ __forceinline__ void multiply_together(float (&d)[8][4], const RowsOfA& a, std::uint64_t b, int add) {
  asm volatile(
      "{\n.reg .pred add;\nsetp.ne.b32 add,%37,0;\n"
      "wgmma.mma_async.sync.aligned.m64n64k16.f32.f16.f16 "
      "{%0,%1,%2,%3,%4,%5,%6,%7,%8,%9,%10,%11,%12,%13,%14,%15,%16,%17,%18,%19,%20,%21,%22,%23,%24,%25,%26,%27,%28,%29,%"
      "30,%31},{%32,%33,%34,%35},%36,add,1,1,0;\n}"
      : ESPALIER_FOUR_SUMS(0), ESPALIER_FOUR_SUMS(4)
      : ESPALIER_ROWS_OF_A, "l"(b), "r"(add));
}
__device__ __forceinline__ void multiply_together(float (&d)[4][4], const RowsOfA& a, std::uint64_t b, int add) {
  asm volatile(
      "{\n.reg .pred add;\nsetp.ne.b32 add,%21,0;\n"
      "wgmma.mma_async.sync.aligned.m64n32k16.f32.f16.f16 "
      "{%0,%1,%2,%3,%4,%5,%6,%7,%8,%9,%10,%11,%12,%13,%14,%15},{%16,%17,%18,%19},%20,add,1,1,0;\n}"
      : ESPALIER_FOUR_SUMS(0)
      : ESPALIER_ROWS_OF_A, "l"(b), "r"(add));
}
#undef ESPALIER_SUMS
#undef ESPALIER_FOUR_SUMS
#undef ESPALIER_ROWS_OF_A

/// What was written to shared memory and to accumulators stands there for the products that follow.
__device__ inline void begin_products() { asm volatile("wgmma.fence.sync.aligned;" ::: "memory"); }
__device__ inline void commit_products() { asm volatile("wgmma.commit_group.sync.aligned;" ::: "memory"); }
/// All products are done.
template <int M, int N>
__device__ inline void wait_for_products(float (&sums)[M][N][4]) {
  asm volatile("wgmma.wait_group.sync.aligned 0;" ::: "memory");
#pragma unroll
  for (int m = 0; m < M; ++m)
#pragma unroll
    for (int n = 0; n < N; ++n)
#pragma unroll
      for (int e = 0; e < 4; ++e) asm volatile("" : "+f"(sums[m][n][e])::"memory");
}

/// From the 64 rows times kM of a block, so many times 64 are multiplied at a time: there are registers for 64 partial
/// sums a thread.
template <class S>
inline constexpr int kRowsAtATime = S::kM* S::kN > 16 ? 16 / S::kN : S::kM;

/// This warp's rows of A in one chunk, split: those of accumulators first, first + 1, ...
template <class S>
struct SplitRows {
  RowsOfA high[kRowsAtATime<S>], low[kRowsAtATime<S>];

  __device__ __forceinline__ SplitRows(const float* a, int first, const Corner<S>& at, float scale) {
#pragma unroll
    for (int m = 0; m < kRowsAtATime<S>; ++m) {
      const float* panel = a + (at.row + S::kRowStep * (first + m)) * kChunk;
      const auto top = split_panel<SplitFormat::half>(panel, at.lane, scale);
      const auto bottom = split_panel<SplitFormat::half>(panel + 128, at.lane, scale);
      high[m] = {{top.high[0], top.high[1]}, {bottom.high[0], bottom.high[1]}};
      low[m] = {{top.low[0], top.low[1]}, {bottom.low[0], bottom.low[1]}};
    }
  }
};

/// sums (+)= A B^T for a chunk; the rows of B have been split in shared memory.
template <class S>
__device__ __forceinline__ void multiply_split_stage(float (&sums)[kRowsAtATime<S>][S::kN][4], const SplitRows<S>& a,
                                                     const float* b, bool add) {
  const std::uint64_t b_high = describe(b, 0), b_low = describe(b, 1);
#pragma unroll
  for (int m = 0; m < kRowsAtATime<S>; ++m) {
    multiply_together(sums[m], a.low[m], b_high, add ? 1 : 0);
    multiply_together(sums[m], a.high[m], b_low, 1);
    multiply_together(sums[m], a.high[m], b_high, 1);
  }
}

/// acc += the sum, by groups of chunks, each a partial sum. Where the last group is short, zeros take the place of the
/// chunks that are missing. Every warp splits its own rows of A on the way to its registers; those of B, which all
/// need, are split in shared memory. While this block splits, the tensor cores have another block's products.
template <class S>
__device__ __forceinline__ void sum_by_warpgroup(Accumulator<float, S>& acc, const ChunkSum<float>& sum,
                                                 ChunkLoader<float, S>& loader, Pipeline<float>& pipe,
                                                 HalfScales scales) {
  constexpr int kTogether = kChunksPerSum, kGroup = kTogether * S::kStage, kRows = kRowsAtATime<S>;
  // The ring is laid out for blocks of one tile column.
  constexpr int kStageInRing = Shape<float, S::kRows, S::kWidth>::kStage;
  constexpr int kB = S::kRows * kChunk;                // where the rows of B begin in a stage
  const int from_b = uniform(sum.same) != 0 ? 0 : kB;  // ... and where they are found
  const Corner<S> at;
  const int groups = (uniform(sum.chunks) + kTogether - 1) / kTogether;
  const int rounds = uniform(pipe.depth) * kStageInRing / kGroup;
  for (int group = 0, round = 0; group < groups; ++group) {
    if (threadIdx.x < 32) loader.template issue_groups<kTogether>(group, group, rounds);
    __syncwarp();
    float* const stages = pipe.stages + round * kGroup;
    pipe.wait(round * kTogether);
    const int missing = max(0, (group + 1) * kTogether - sum.chunks);
    for (int x = static_cast<int>(threadIdx.x); x < missing * S::kStage; x += kThreads)
      stages[(kTogether - missing) * S::kStage + x] = 0;
    if (missing > 0) __syncthreads();
    split_rows<S::kCols, kTogether>(stages + from_b, stages + kB, S::kStage, scales.b);
    fence_shared();
    __syncthreads();
    SplitRows<S> head(stages, 0, at, scales.a);  // of the first chunk, while products are still under way
#pragma unroll
    for (int m = 0; m < S::kM; m += kRows) {
      float sums[kRows][S::kN][4];
      begin_products();
      multiply_split_stage<S>(sums, head, stages + kB, false);
#pragma unroll
      for (int k = 1; k < kTogether; ++k) {
        const SplitRows<S> a(stages + k * S::kStage, m, at, scales.a);
        begin_products();
        multiply_split_stage<S>(sums, a, stages + k * S::kStage + kB, true);
      }
      commit_products();
      if (m + kRows < S::kM) head = SplitRows<S>(stages, m + kRows, at, scales.a);
      wait_for_products(sums);
#pragma unroll
      for (int x = 0; x < kRows; ++x) take_sums<SplitFormat::half>(acc[m + x], sums[x], scales);
    }
    __syncthreads();
    round = round + 1 == rounds ? 0 : round + 1;
  }
}

#else

template <class S>
__device__ void sum_by_warpgroup(Accumulator<float, S>&, const ChunkSum<float>&, ChunkLoader<float, S>&,
                                 Pipeline<float>&, HalfScales) {}

#endif

}  // namespace espalier::device::cuda

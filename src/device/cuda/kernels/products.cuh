/// \file
/// Sums of products of finished blocks: operands stream through shared memory by bulk copies, tensor cores multiply.
#pragma once

#include "device/cuda/kernels/factor_state.cuh"

namespace espalier::device::cuda {

/// Shape of a block of `Rows` x `Width` and how the four warps share it.
template <int Rows, int Width>
struct Shape {
  static constexpr int kRows = Rows;
  static constexpr int kWidth = Width;
  static constexpr int kWarpsN = Width == 64 ? 2 : (Rows == 32 ? 2 : 1);
  static constexpr int kWarpsM = 4 / kWarpsN;
  static constexpr int kWarpRows = Rows / kWarpsM;
  static constexpr int kWarpCols = Width / kWarpsN;
  static constexpr int kM = kWarpRows / 16;  ///< 16 x 8 accumulators of a warp
  static constexpr int kN = kWarpCols / 8;
  static constexpr int kStage = (Rows + Width) * kChunk;  ///< elements of one pipeline stage
  static constexpr int kLd = Rows + 4;                    ///< of a column-major scratch tile, free of bank conflicts
};

template <class T, class S>
using Accumulator = T[S::kM][S::kN][4];

template <class T>
__device__ inline PairOf<T> load_pair(const T* p) {
  return *reinterpret_cast<const PairOf<T>*>(p);
}

/// This warp's corner of the block.
template <class S>
struct Corner {
  int row, col, lane;
  __device__ Corner() {
    const int warp = static_cast<int>(threadIdx.x) >> 5;
    lane = static_cast<int>(threadIdx.x) & 31;
    row = warp % S::kWarpsM * S::kWarpRows;
    col = warp / S::kWarpsM * S::kWarpCols;
  }
};

/// acc += A B^T for one chunk of 16 columns; A (kRows x 16) and B (kWidth x 16) in panels in shared memory.
template <class T, class S>
__device__ inline void multiply_chunk(Accumulator<T, S>& acc, const T* a, const T* b, const Corner<S>& at) {
  T right[S::kN][4];
#pragma unroll
  for (int n = 0; n < S::kN; ++n) {
    const T* panel = b + (at.col / 8 + n) * 128 + at.lane * 2;
    const auto lo = load_pair(panel);
    const auto hi = load_pair(panel + 64);
    right[n][0] = lo.x;
    right[n][1] = lo.y;
    right[n][2] = hi.x;
    right[n][3] = hi.y;
  }
  // Operand A by single elements, so that each goes to the register in which the instruction wants it: pairs come in
  // another order and cost ten moves an instruction. odd is even + 8, which the compiler must not know, or it would
  // make pairs of them again.
  unsigned even = 0, odd = 0;
  if constexpr (sizeof(T) == 8) {
    even = shared_address(a + at.row * kChunk + at.lane * 2);
    odd = even ^ sizeof(T);
  }
#pragma unroll
  for (int m = 0; m < S::kM; ++m) {
    T left[8];
#pragma unroll
    for (int h = 0; h < 2; ++h) {
      if constexpr (sizeof(T) == 8) {
        const unsigned panel = (2 * m + h) * 128 * sizeof(T);
        left[h] = load_element(even + panel, T());
        left[2 + h] = load_element(odd + panel, T());
        left[4 + h] = load_element(even + panel + 64 * sizeof(T), T());
        left[6 + h] = load_element(odd + panel + 64 * sizeof(T), T());
      } else {
        const T* panel = a + (at.row / 8 + 2 * m + h) * 128 + at.lane * 2;
        const auto lo = load_pair(panel);
        const auto hi = load_pair(panel + 64);
        left[h] = lo.x;
        left[2 + h] = lo.y;
        left[4 + h] = hi.x;
        left[6 + h] = hi.y;
      }
    }
#pragma unroll
    for (int n = 0; n < S::kN; ++n) multiply_add(acc[m][n], left, right[n]);
  }
}

/// use(m, n, e, row, col) for every accumulator element of this lane.
template <class S, class Use>
__device__ inline void for_each_element(const Corner<S>& at, Use&& use) {
  const int g = at.lane >> 2, t = at.lane & 3;
#pragma unroll
  for (int m = 0; m < S::kM; ++m)
#pragma unroll
    for (int n = 0; n < S::kN; ++n)
#pragma unroll
      for (int e = 0; e < 4; ++e) use(m, n, e, at.row + 16 * m + g + 8 * (e >> 1), at.col + 8 * n + 2 * t + (e & 1));
}

/// Writes sign * acc in panels: chunk q at to + q * chunk_stride; `rows` and `cols` are multiples of 16.
template <class T, class S>
__device__ inline void store_panels(const Accumulator<T, S>& acc, T sign, T* to, std::int64_t chunk_stride, int rows,
                                    int cols, const Corner<S>& at) {
  const int t = at.lane & 3;
  const int slot = (at.lane & ~3) + ((t & 1) << 1) + (t >> 1);
#pragma unroll
  for (int m = 0; m < S::kM; ++m)
#pragma unroll
    for (int n = 0; n < S::kN; ++n)
#pragma unroll
      for (int h = 0; h < 2; ++h) {
        // Lanes t and t + 2 hold the two halves of two words; they exchange one element each.
        const T first = sign * acc[m][n][2 * h], second = sign * acc[m][n][2 * h + 1];
        const T other = __shfl_xor_sync(0xffffffffu, t < 2 ? second : first, 2);
        const int r = at.row + 16 * m + 8 * h, c = at.col + 8 * n;
        if (r >= rows || c >= cols) continue;
        PairOf<T> word;
        word.x = t < 2 ? first : other;
        word.y = t < 2 ? other : second;
        *reinterpret_cast<PairOf<T>*>(to + (c >> 4) * chunk_stride + (r >> 3) * 128 + (c >> 3 & 1) * 64 + slot * 2) =
            word;
      }
}

/// Front::chunk_offset() for tile columns of a width that the compiler knows.
template <int Width>
__device__ inline std::int64_t chunk_offset(int total_pad, int chunk, int row) {
  constexpr int kPerTile = Width / kChunk;
  const int j = chunk / kPerTile, height = total_pad - j * Width;
  return (static_cast<std::int64_t>(j) * total_pad - static_cast<std::int64_t>(Width) * j * (j - 1) / 2) * Width +
         (static_cast<std::int64_t>(chunk % kPerTile) * height + (row - j * Width)) * kChunk;
}

/// Where one operand comes from: chunk q starts at base + front.chunk_offset(q, row).
template <class T>
struct Operand {
  const T* base;
  int row;   ///< padded row of the front, a multiple of 16
  int rows;  ///< a multiple of 16
};

/// The pipeline of stages in shared memory. `phases` holds one parity bit per barrier and lives across tasks.
template <class T>
struct Pipeline {
  T* stages;
  std::uint64_t* barriers;
  int depth;  ///< stages
  unsigned phases;
  unsigned* waited = nullptr;  ///< nanoseconds that the task has waited so far; written by one lane

  __device__ void wait(int stage) {
    barrier_wait(barriers + stage, phases >> stage & 1);
    phases ^= 1u << stage;
  }
};

/// acc += sum over chunks q < chunks of A_q B_q^T, each as soon as the flags of its tile column are set.
/// flag_a, flag_b: flags of (row block of A, column 0) and (row block of B, column 0); flags of the next tile column
/// follow `flag_stride` later. same: A and B are the same rows of the same array.
template <class T, class S>
__device__ void sum_products(Accumulator<T, S>& acc, const Front& f, const Operand<T>& a, const Operand<T>& b,
                             bool same, int chunks, const int* flag_a, const int* flag_b, int flag_stride,
                             Pipeline<T>& pipe, int* control, std::uint64_t patience) {
  const Corner<S> at;
  constexpr int per_tile = S::kWidth / kChunk;  // f.width == S::kWidth
  const bool active = at.row < a.rows && at.col < b.rows;
#if ESPALIER_BULK_COPIES
  const int columns = (chunks + per_tile - 1) / per_tile;
  const int depth = pipe.depth;
  int issued = 0, ready = 0, stage_in = 0, stage_out = 0;
  const auto poll = [&] {  // warp 0: how many tile columns are finished from the left
    int now = ready + at.lane < columns;
    if (now) {
      const std::int64_t k = static_cast<std::int64_t>(ready + at.lane) * flag_stride;
      now = load_acquire(flag_a + k) != 0 && (flag_a == flag_b || load_acquire(flag_b + k) != 0);
    }
    const unsigned mask = __ballot_sync(0xffffffffu, now);
    ready += mask == 0xffffffffu ? 32 : __ffs(~mask) - 1;
    __syncwarp();
    fence_copies();
  };
  const auto issue = [&](int q) {  // warp 0: have at least chunk q on its way, and as many more as there is room for
    std::uint64_t start = 0;
    while (issued < chunks && issued < q + depth) {
      if (issued / per_tile >= ready) {
        poll();
        if (issued / per_tile >= ready) {
          if (issued > q) break;
          const std::uint64_t now = global_nanoseconds();
          if (start == 0) start = now;
          if (now - start > patience) atomicExch(control + kAborted, 1);
          if (now - start > 20000 && aborted(control)) ready = columns;
          continue;
        }
      }
      if (at.lane == 0) {
        std::uint64_t* bar = pipe.barriers + stage_in;
        T* to = pipe.stages + stage_in * S::kStage;
        const unsigned bytes_a = a.rows * kChunk * sizeof(T), bytes_b = same ? 0 : b.rows * kChunk * sizeof(T);
        barrier_expect(bar, bytes_a + bytes_b);
        bulk_copy(to, a.base + chunk_offset<S::kWidth>(f.total_pad, issued, a.row), bytes_a, bar);
        if (!same)
          bulk_copy(to + S::kRows * kChunk, b.base + chunk_offset<S::kWidth>(f.total_pad, issued, b.row), bytes_b, bar);
      }
      if (start != 0 && at.lane == 0 && pipe.waited != nullptr) {
        *pipe.waited += static_cast<unsigned>(global_nanoseconds() - start);
      }
      start = 0;
      ++issued;
      stage_in = stage_in + 1 == depth ? 0 : stage_in + 1;
    }
  };
  for (int q = 0; q < chunks; ++q) {
    if (threadIdx.x < 32) issue(q);
    __syncwarp();
    pipe.wait(stage_out);
    const T* left = pipe.stages + stage_out * S::kStage;
    if (active) multiply_chunk<T, S>(acc, left, same ? left : left + S::kRows * kChunk, at);
    stage_out = stage_out + 1 == depth ? 0 : stage_out + 1;
    __syncthreads();
  }
#else
  for (int q = 0; q < chunks; ++q) {
    if (q % per_tile == 0 && threadIdx.x < 2) {
      const std::int64_t k = static_cast<std::int64_t>(q / per_tile) * flag_stride;
      wait_for((threadIdx.x == 0 ? flag_a : flag_b) + k, 1, control, patience);
    }
    __syncthreads();
    const T* from_a = a.base + f.chunk_offset(q, a.row);
    const T* from_b = b.base + f.chunk_offset(q, b.row);
    T* left = pipe.stages;
    T* right = left + S::kRows * kChunk;
    for (int x = threadIdx.x; x < a.rows * kChunk; x += kThreads) left[x] = from_a[x];
    for (int x = threadIdx.x; x < b.rows * kChunk; x += kThreads) right[x] = from_b[x];
    __syncthreads();
    if (active) multiply_chunk<T, S>(acc, left, right, at);
    __syncthreads();
  }
#endif
}

}  // namespace espalier::device::cuda

/// \file
/// A block of a front in the registers of four warps, as the tensor cores want it: products of chunks, its elements,
/// its way back to memory.
#pragma once

#include "device/cuda/kernels/factor/factor_state.cuh"
#include "espalier/types.hpp"

namespace espalier::device::cuda {

/// Shape of a block of `Rows` rows in `Columns` tile columns of `Width` and how the four warps share it: each has a
/// corner, or, where they multiply together as a warpgroup, 16 of every 64 rows.
template <class T, int Rows, int Width, int Columns = 1>
struct Shape {
  static constexpr bool kHalf = false;  ///< see half_products.cuh
  static constexpr int kRows = Rows;
  static constexpr int kWidth = Width;           ///< of a tile column
  static constexpr int kCols = Width * Columns;  ///< of the block
  static constexpr bool kWarpgroup = ESPALIER_WARPGROUP_PRODUCTS && sizeof(T) == 4 && Rows % 64 == 0;
  static constexpr int kWarpsN = kWarpgroup ? 1 : (Width == 64 ? 2 : (Rows == 32 ? 2 : 1));
  static constexpr int kWarpsM = 4 / kWarpsN;
  static constexpr int kWarpRows = kWarpgroup ? 16 : Rows / kWarpsM;  ///< from one warp's first row to the next one's
  static constexpr int kWarpCols = kCols / kWarpsN;
  static constexpr int kRowStep = kWarpgroup ? 64 : 16;  ///< from one of its accumulators to the next one
  static constexpr int kM = Rows / kWarpsM / 16;         ///< 16 x 8 accumulators of a warp
  static constexpr int kN = kWarpCols / 8;
  static constexpr int kStage = (Rows + kCols) * kChunk;  ///< elements of one pipeline stage
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

/// What this lane reads of accumulator n's rows of B: their row g, or, of half of the columns, one row of pair g.
template <class S>
__device__ inline const double* right_panel(const double* b, const Corner<S>& at, int n) {
  if constexpr (S::kHalf) {
    const int g = at.lane >> 2, t = at.lane & 3;
    return b + (at.col / 8 + 2 * n + (g >> 2)) * 128 + (2 * (g & 3) + (g & 1)) * 8 + t * 2;
  } else {
    return b + (at.col / 8 + n) * 128 + at.lane * 2;
  }
}

/// acc += A B^T for one chunk of 16 columns; A (kRows x 16) and B (kWidth x 16) in panels in shared memory.
template <class S>
__device__ inline void multiply_chunk(Accumulator<double, S>& acc, const double* a, const double* b,
                                      const Corner<S>& at) {
  double right[S::kN][4];
#pragma unroll
  for (int n = 0; n < S::kN; ++n) {
    const double* panel = right_panel<S>(b, at, n);
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
  const unsigned even = shared_address(a + at.row * kChunk + at.lane * 2);
  const unsigned odd = even ^ sizeof(double);
#pragma unroll
  for (int m = 0; m < S::kM; ++m) {
    double left[8];
#pragma unroll
    for (int h = 0; h < 2; ++h) {
      const unsigned panel = (2 * m + h) * 128 * sizeof(double);
      left[h] = load_element(even + panel, double());
      left[2 + h] = load_element(odd + panel, double());
      left[4 + h] = load_element(even + panel + 64 * sizeof(double), double());
      left[6 + h] = load_element(odd + panel + 64 * sizeof(double), double());
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
      for (int e = 0; e < 4; ++e)
        use(m, n, e, at.row + S::kRowStep * m + g + 8 * (e >> 1), at.col + 8 * n + 2 * t + (e & 1));
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
        const int r = at.row + S::kRowStep * m + 8 * h, c = at.col + 8 * n;
        if (r >= rows || c >= cols) continue;
        PairOf<T> word;
        word.x = t < 2 ? first : other;
        word.y = t < 2 ? other : second;
        *reinterpret_cast<PairOf<T>*>(to + (c >> 4) * chunk_stride + (r >> 3) * 128 + (c >> 3 & 1) * 64 + slot * 2) =
            word;
      }
}

}  // namespace espalier::device::cuda

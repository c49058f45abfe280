/// \file
/// Products of the real form of a complex system (solver/analysis/real_form.hpp), half of which tell the other half.
///
/// Rows 2i, 2i + 1 and columns 2k, 2k + 1 of a front stand for one complex number,
///   [[a, -b], [-b, -a]] (sign 1) or, of a Hermitian matrix, [[a, -b], [b, a]] (sign -1),
/// in the matrix, and so in all that is left when whole pairs of pivots are eliminated: one column of a pair tells the
/// other one. Of 16 columns eight are summed: 2k where k is even, 2k + 1 where it is odd. Their rows of the second
/// operand are then read without bank conflicts. The work is that of complex numbers: four real products for each.
#pragma once

#include "device/cuda/kernels/gather.cuh"
#include "device/cuda/kernels/products.cuh"

namespace espalier::device::cuda {

/// The shape of the sums for a block of shape S.
template <class S>
struct HalfShape : S {
  static constexpr bool kHalf = true;
  static constexpr int kN = S::kN / 2;
};

/// half = -(what was gathered), as take_gathered(). Elements above the diagonal may not have been gathered: within a
/// pair they are made from the one below it.
/// @param diagonal  row of the block's first element less its column, in the front
template <class T, class S>
__device__ inline void take_gathered_half(Accumulator<T, HalfShape<S>>& half, const T* area, bool any, int diagonal,
                                          T sign) {
  const Corner<S> at;
  const int g = at.lane >> 2, t = at.lane & 3;
#pragma unroll
  for (int m = 0; m < S::kM; ++m)
#pragma unroll
    for (int n = 0; n < S::kN / 2; ++n)
#pragma unroll
      for (int e = 0; e < 4; ++e) {
        const int r = at.row + S::kRowStep * m + g + 8 * (e >> 1), c = at.col + 16 * n + 4 * t + 3 * (e & 1);
        const bool above = (e & 1) != 0 && r + diagonal == c - 1;
        const T x = !any ? T(0) : above ? sign * area[(c - 1) * S::kLd + r + 1] : area[c * S::kLd + r];
        half[m][n][e] = -x;
      }
  fence_shared();
  __syncthreads();
}

/// All columns from half of them. By all lanes.
template <class T, class S>
__device__ inline void complete(Accumulator<T, S>& acc, const Accumulator<T, HalfShape<S>>& half, T sign) {
  const int lane = static_cast<int>(threadIdx.x) & 31, t = lane & 3;
  const bool odd = (t & 1) != 0;                    // the second column of this lane's pair was summed
  const T s = (lane >> 2 & 1) != 0 ? -sign : sign;  // of the lane's rows, which are all odd or all even
#pragma unroll
  for (int m = 0; m < S::kM; ++m)
#pragma unroll
    for (int n = 0; n < S::kN / 2; ++n)
#pragma unroll
      for (int u = 0; u < 2; ++u)
#pragma unroll
        for (int h = 0; h < 2; ++h) {
          const int from = (lane & ~3) | (2 * h + (t >> 1));
          const T x = __shfl_sync(0xffffffffu, half[m][n][2 * u], from);
          const T y = __shfl_sync(0xffffffffu, half[m][n][2 * u + 1], from);
          const T own = odd ? y : x;
          const T other = __shfl_xor_sync(0xffffffffu, own, 4);  // the same column in the other row of the pair
          acc[m][2 * n + h][2 * u] = odd ? -s * other : own;
          acc[m][2 * n + h][2 * u + 1] = odd ? own : s * other;
        }
}

/// acc = sum of products - what was gathered. Starts after gather(); ends with a barrier.
/// @param diagonal  see take_gathered_half()
template <bool Half, class T, class S>
__device__ __forceinline__ void sum_tile(Accumulator<T, S>& acc, Workshop<T>& w, const ChunkSum<T>& sum, bool any,
                                         int diagonal, HalfScales scales) {
  const FactorState<T>& s = *w.state;
  if constexpr (Half) {
    T half[S::kM][S::kN / 2][4];
    take_gathered_half<T, S>(half, w.pipe.stages, any, diagonal, w.pair_sign);
    sum_products<T, HalfShape<S>>(half, sum, w.pipe, s.control, s.patience, scales);
    complete<T, S>(acc, half, w.pair_sign);
  } else {
    take_gathered<T, S>(acc, w.pipe.stages, any);
    sum_products<T, S>(acc, sum, w.pipe, s.control, s.patience, scales);
  }
}

}  // namespace espalier::device::cuda

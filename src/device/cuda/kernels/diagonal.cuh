/// \file
/// A diagonal tile: factor it and invert the factor, in shared memory, column-major, by one block of threads. The
/// factor itself is not kept: M = inverse(L) P is what the column below and the solve need.
#pragma once

#include "device/cuda/kernels/pivots.cuh"
#include "device/cuda/kernels/products.cuh"

namespace espalier::device::cuda {

/// What a pivot block tells about itself; for the pivots from `position` on.
template <class T>
struct PivotSink {
  const FactorState<T>* state;
  int position;
  int n;  ///< unknowns of the matrix, for kNotPositive
};

/// c (16 x 8) += A (16 x 16) B (16 x 8) from shared memory: A(r, k) = a[r * ar + k * ak], B(k, n) = b[k * bk + n * bn].
template <class T>
__device__ inline void multiply_shared(T (&c)[4], const T* a, int ar, int ak, const T* b, int bk, int bn) {
  const int lane = static_cast<int>(threadIdx.x) & 31, g = lane >> 2, t = lane & 3;
  T left[8], right[4];
#pragma unroll
  for (int u = 0; u < 8; ++u) left[u] = a[(g + 8 * (u & 1)) * ar + (4 * (u >> 1) + t) * ak];
#pragma unroll
  for (int u = 0; u < 4; ++u) right[u] = b[(4 * u + t) * bk + g * bn];
  multiply_add(c, left, right);
}

/// c = sign * accumulators, element (r, n) at to[r * tr + n * tn]; add: c += instead.
template <class T>
__device__ inline void put_shared(const T (&c)[4], T sign, bool add, T* to, int tr, int tn) {
  const int lane = static_cast<int>(threadIdx.x) & 31, g = lane >> 2, t = lane & 3;
#pragma unroll
  for (int e = 0; e < 4; ++e) {
    T* x = to + (g + 8 * (e >> 1)) * tr + (2 * t + (e & 1)) * tn;
    *x = (add ? *x : T(0)) + sign * c[e];
  }
}

/// L and inverse(L) of a 16 x 16 block by one warp: lanes 0..15 hold the rows of the block, lanes 16..31 those of the
/// inverse. Writes the inverse (zeros above its diagonal) to m. Pivots that are not positive are reported and taken
/// as 1.
template <class T>
__device__ void factor_block16(const T* a, int lda, T* m, int ldm, int first, int pivots, const PivotSink<T>& sink) {
  const int lane = static_cast<int>(threadIdx.x) & 31, r = lane & 15;
  const bool lower = lane < 16;
  T x[16];
#pragma unroll
  for (int c = 0; c < 16; ++c) x[c] = lower ? a[c * lda + r] : (c == r ? T(1) : T(0));
#pragma unroll
  for (int k = 0; k < 16; ++k) {
    T d = __shfl_sync(0xffffffffu, x[k], k);
    if (!(d > T(0))) {
      if (lane == 0) atomicMax(sink.state->control + kNotPositive, sink.n - (sink.position + first + k));
      d = T(1);
    }
    if (lane == k && first + k < pivots) sink.state->pivot[sink.position + first + k] = d;
    const T inverse = inverse_square_root(d);
    const T mine = x[k] * inverse;
    const T l = __shfl_sync(0xffffffffu, mine, r);  // L(r, k), for the inverse's rows too
    const T below = r > k ? l : T(0);
#pragma unroll
    for (int c = k + 1; c < 16; ++c) {
      const T lc = __shfl_sync(0xffffffffu, mine, c);
      if (lower) x[c] -= below * lc;
    }
#pragma unroll
    for (int c = 0; c <= k; ++c) {
      const T row = __shfl_sync(0xffffffffu, x[c], 16 + k) * inverse;
      if (!lower) x[c] = r == k ? row : x[c] - below * row;
    }
  }
  if (!lower)
#pragma unroll
    for (int c = 0; c < 16; ++c) m[c * ldm + r] = c <= r ? x[c] : T(0);
}

/// use(row, column) for every place of a square; by all threads.
template <class Use>
__device__ inline void for_each_in_square(int size, Use&& use) {
  const int warp = static_cast<int>(threadIdx.x) >> 5, lane = static_cast<int>(threadIdx.x) & 31;
  for (int c = warp; c < size; c += kThreads / 32)
    for (int r = lane; r < size; r += 32) use(r, c);
}

/// M = inverse(L) of the lower triangle of A (size x size, a multiple of 16) = L L^T. A is destroyed.
template <class T>
__device__ inline void invert_cholesky(T* a, int lda, int size, int pivots, T* m, int ldm, const PivotSink<T>& sink) {
  const int warp = static_cast<int>(threadIdx.x) >> 5;
  const int blocks = size / 16;
  for_each_in_square(size, [&](int r, int c) { m[c * ldm + r] = T(0); });
  __syncthreads();
  for (int p = 0; p < blocks; ++p) {
    T* diagonal = a + 16 * p * lda + 16 * p;
    T* inverse = m + 16 * p * ldm + 16 * p;
    if (warp == 0) factor_block16(diagonal, lda, inverse, ldm, 16 * p, pivots, sink);
    __syncthreads();
    // L(i, p) = A(i, p) W^T below; M(p, j) = W M(p, j) to the left.
    for (int x = warp; x < blocks - 1; x += 4) {
      T c[2][4] = {};
      if (x < p) {
        T* block = m + 16 * x * ldm + 16 * p;
        for (int h = 0; h < 2; ++h) multiply_shared(c[h], inverse, 1, ldm, block + 8 * h * ldm, 1, ldm);
        __syncwarp();
        for (int h = 0; h < 2; ++h) put_shared(c[h], T(1), false, block + 8 * h * ldm, 1, ldm);
      } else {
        T* block = a + 16 * p * lda + 16 * (x + 1);
        for (int h = 0; h < 2; ++h) multiply_shared(c[h], block, 1, lda, inverse + 8 * h, ldm, 1);
        __syncwarp();
        for (int h = 0; h < 2; ++h) put_shared(c[h], T(1), false, block + 8 * h * lda, 1, lda);
      }
    }
    __syncthreads();
    // A(i, j) -= L(i, p) L(j, p)^T for j > p; M(i, j) -= L(i, p) M(p, j) for j <= p: one block column each per turn.
    const int below = blocks - 1 - p;
    for (int x = warp; x < below * blocks; x += 4) {
      const int i = p + 1 + x / blocks, j = x % blocks;
      if (j > i) continue;
      const T* left = a + 16 * p * lda + 16 * i;
      T c[2][4] = {};
      if (j > p) {
        for (int h = 0; h < 2; ++h) {
          multiply_shared(c[h], left, 1, lda, a + 16 * p * lda + 16 * j + 8 * h, lda, 1);
          put_shared(c[h], T(-1), true, a + (16 * j + 8 * h) * lda + 16 * i, 1, lda);
        }
      } else {
        for (int h = 0; h < 2; ++h) {
          multiply_shared(c[h], left, 1, lda, m + (16 * j + 8 * h) * ldm + 16 * p, 1, ldm);
          put_shared(c[h], T(-1), true, m + (16 * j + 8 * h) * ldm + 16 * i, 1, ldm);
        }
      }
    }
    __syncthreads();
  }
}

/// M = inverse(L) P with P A P^T = L D L^T; A (pivots x pivots) is given by its lower triangle and destroyed; D^-1 goes
/// to the state. M is size x size with ones on the diagonal of the padding.
template <class T>
__device__ inline void invert_ldlt(T* a, int lda, int size, int pivots, T* m, int ldm, const PivotSink<T>& sink) {
  const auto run = [&](auto block) {
    block.eliminate();
    block.store(m, ldm, sink);
  };
  const T tiny = sink.state->tiny();
  if (size == 16)
    run(PivotBlock<T, 4>(a, lda, pivots, tiny));
  else if (size == 32)
    run(PivotBlock<T, 8>(a, lda, pivots, tiny));
  else if (size == 48)
    run(PivotBlock<T, 12>(a, lda, pivots, tiny));
  else
    run(PivotBlock<T, 16>(a, lda, pivots, tiny));
}

/// Writes a block of shared memory, element (r, c) at from[r * fr + c * fc], in panels; rows, cols multiples of 16.
template <class T>
__device__ inline void write_panels(const T* from, int fr, int fc, int rows, int cols, T* to,
                                    std::int64_t chunk_stride) {
  const int warp = static_cast<int>(threadIdx.x) >> 5, lane = static_cast<int>(threadIdx.x) & 31;
  const int panels = rows / kPanel;
  for (int q = 0, panel = warp;; panel += kThreads / 32) {
    for (; panel >= panels; panel -= panels) ++q;
    if (q * kChunk >= cols) break;
    const T* x = from + (panel * kPanel + (lane >> 2)) * fr + (q * kChunk + (lane & 3)) * fc;
    T* at = to + q * chunk_stride + panel * 128 + lane * 2;
#pragma unroll
    for (int h = 0; h < 2; ++h) {
      PairOf<T> word;
      word.x = x[8 * h * fc];
      word.y = x[(8 * h + 4) * fc];
      *reinterpret_cast<PairOf<T>*>(at + 64 * h) = word;
    }
  }
}

}  // namespace espalier::device::cuda

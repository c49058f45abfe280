/// \file
/// A diagonal tile: factor it and invert the factor, in shared memory, column-major, by one block of threads. The
/// factor itself is not kept: M = inverse(L) P is what the column below and the solve need.
#pragma once

#include "device/cuda/pivots.cuh"
#include "device/cuda/products.cuh"

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

/// The row of largest magnitude (by magnitude_key(); ties: the lowest) among rows [begin, n), n <= 64, of a column,
/// without row `skip`, and that magnitude; every lane gets it. Without any row: 0 and -1.
template <class T>
struct Largest {
  T value;
  int row;
};
template <class T>
__device__ inline Largest<T> largest_in_column(const T* column, int begin, int n, int skip) {
  const int lane = static_cast<int>(threadIdx.x) & 31;
  unsigned key[2];  // 0: no row; the key of a row plus 1
#pragma unroll
  for (int h = 0; h < 2; ++h) {
    const int r = lane + 32 * h;
    key[h] = r >= begin && r < n && r != skip ? magnitude_key(column[r]) + 1 : 0;
  }
#if defined(__CUDA_ARCH__)
  const unsigned best = __reduce_max_sync(0xffffffffu, max(key[0], key[1]));
#else
  const unsigned best = 0;
#endif
  if (best == 0) return {T(0), -1};
  const unsigned low = __ballot_sync(0xffffffffu, key[0] == best), high = __ballot_sync(0xffffffffu, key[1] == best);
  const int row = low != 0 ? __ffs(static_cast<int>(low)) - 1 : 31 + __ffs(static_cast<int>(high));
  const T v = column[row];
  return {v < T(0) ? -v : v, row};
}

/// Exchanges rows p and q of A (columns [from, n)) and of M (all columns).
template <class T>
__device__ inline void swap_rows(T* a, int lda, T* m, int ldm, int n, int from, int p, int q) {
  for (int c = threadIdx.x; c < 2 * n; c += kThreads) {
    T* column = c < n ? a + c * lda : m + (c - n) * ldm;
    if (c < n && c < from) continue;
    const T v = column[p];
    column[p] = column[q];
    column[q] = v;
  }
}

/// Exchanges rows and columns p and q of the symmetric A from `from` on, and the rows of M. Starts and ends with a
/// barrier.
template <class T>
__device__ inline void swap_symmetric(T* a, int lda, T* m, int ldm, int n, int from, int p, int q) {
  if (p == q) return;
  __syncthreads();
  swap_rows(a, lda, m, ldm, n, from, p, q);
  __syncthreads();
  for (int r = from + static_cast<int>(threadIdx.x); r < n; r += kThreads) {
    const T v = a[p * lda + r];
    a[p * lda + r] = a[q * lda + r];
    a[q * lda + r] = v;
  }
  __syncthreads();
}

/// Rows r >= after of [A | M] lose l1(r) times row k and l2(r) times row k + 1 (l2 only for two); columns of A from
/// `after` on. A lane owns rows, a warp the columns with its number modulo four; size <= 64.
template <class T>
__device__ inline void eliminate_rows(T* a, int lda, T* m, int ldm, int n, int k, int after, bool two, const T (&l1)[2],
                                      const T (&l2)[2]) {
  const int warp = static_cast<int>(threadIdx.x) >> 5, lane = static_cast<int>(threadIdx.x) & 31;
  const int first = after + ((warp - after) & 3);  // A's columns of this warp, then M's
  const int mine = first < n ? (n - first + 3) / 4 : 0, all = mine + (n - warp + 3) / 4;
  constexpr int kAtOnce = 4;
  for (int y = 0; y < all; y += kAtOnce) {
    T* x[kAtOnce];
    T p[kAtOnce], q[kAtOnce], v[kAtOnce][2];
#pragma unroll
    for (int k2 = 0; k2 < kAtOnce; ++k2) {
      const int z = min(y + k2, all - 1);
      x[k2] = z < mine ? a + (first + 4 * z) * lda : m + (warp + 4 * (z - mine)) * ldm;
      p[k2] = x[k2][k];
      q[k2] = two ? x[k2][k + 1] : T(0);
#pragma unroll
      for (int h = 0; h < 2; ++h) v[k2][h] = lane + 32 * h < n ? x[k2][lane + 32 * h] : T(0);
    }
#pragma unroll
    for (int k2 = 0; k2 < kAtOnce; ++k2)
#pragma unroll
      for (int h = 0; h < 2; ++h) {
        const int r = lane + 32 * h;
        const T change = l1[h] * p[k2] + (two ? l2[h] * q[k2] : T(0));
        if (y + k2 < all && r >= after && r < n) x[k2][r] = v[k2][h] - change;
      }
  }
}

/// M = identity (size x size).
template <class T>
__device__ inline void set_identity(T* m, int ldm, int size) {
  for_each_in_square(size, [&](int r, int c) { m[c * ldm + r] = r == c ? T(1) : T(0); });
}

/// A replacement for a pivot that is too small; counts it.
template <class T>
__device__ inline T acceptable_pivot(T d, int k, const PivotSink<T>& sink, bool& small) {
  const T magnitude = d < T(0) ? -d : d;
  small = !(magnitude >= sink.state->tiny()) || magnitude == T(0);
  if (!small) return d;
  if (threadIdx.x == 0) {
    sink.state->replaced[sink.position + k] = 1;
    atomicAdd(sink.state->control + kReplaced, 1);
  }
  const T least = sink.state->tiny() > T(0) ? sink.state->tiny() : T(1e-30);
  return d < T(0) ? -least : least;
}

/// The pivot of step k of the symmetric factorization: one or two rows and columns to bring to k (and k + 1).
struct PivotChoice {
  int first;
  int second;  ///< -1: a 1x1 pivot
};

/// Bounded Bunch-Kaufman ("rook") search (Ashcraft, Grimes, Lewis 1998). Every warp finds the same.
template <class T>
__device__ PivotChoice choose_pivot(const T* a, int lda, int n, int k, T tiny) {
  const T alpha = T(0.6403882032022076);  // (1 + sqrt 17) / 8
  const auto magnitude = [&](int r) { return a[r * lda + r] < T(0) ? -a[r * lda + r] : a[r * lda + r]; };
  Largest<T> best = largest_in_column(a + k * lda, k, n, k);
  if (best.row < 0 || magnitude(k) >= alpha * best.value) return {k, -1};
  if (!(best.value >= tiny) && !(magnitude(k) >= tiny)) return {k, -1};
  int i = k;
  for (int step = 0; step < n; ++step) {
    const int r = best.row;
    const Largest<T> next = largest_in_column(a + r * lda, k, n, r);
    if (magnitude(r) >= alpha * next.value) return {r, -1};
    if (!(next.value > best.value)) return i < r ? PivotChoice{i, r} : PivotChoice{r, i};
    i = r;
    best = next;
  }
  return {k, -1};
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

/// M = inverse(L) P with P A = L U by partial pivoting; U is left in the upper triangle of A.
template <class T>
__device__ inline void invert_lower_lu(T* a, int lda, int size, int pivots, T* m, int ldm, const PivotSink<T>& sink) {
  const FactorState<T>& s = *sink.state;
  const int lane = static_cast<int>(threadIdx.x) & 31, n = pivots;
  set_identity(m, ldm, size);
  for (int k = 0; k < n; ++k) {
    __syncthreads();
    const Largest<T> best = largest_in_column(a + k * lda, k, n, -1);
    const int row = best.row < 0 || !(best.value > T(0)) ? k : best.row;
    if (row != k) {
      __syncthreads();
      swap_rows(a, lda, m, ldm, n, k, k, row);
      __syncthreads();
    }
    T* column = a + k * lda;
    bool small = false;
    const T given = column[k];
    const T d = acceptable_pivot(given, k, sink, small);
    T l1[2] = {}, l2[2] = {};
    const T inverse = T(1) / d;
    for (int h = 0; h < 2; ++h)
      if (lane + 32 * h < n) l1[h] = column[lane + 32 * h] * inverse;
    if (threadIdx.x == 0) s.pivot[sink.position + k] = row == k ? d : -d;
    eliminate_rows(a, lda, m, ldm, n, k, k + 1, false, l1, l2);
    if (small) {
      __syncthreads();
      if (threadIdx.x == 0) column[k] = d;
    }
  }
  __syncthreads();
}

/// V = transpose of inverse(U), lower triangular, from the upper triangle of A; ones on the diagonal of the padding.
template <class T>
__device__ inline void invert_upper_lu(const T* a, int lda, int size, int pivots, T* v, int ldv) {
  const int warp = static_cast<int>(threadIdx.x) >> 5, lane = static_cast<int>(threadIdx.x) & 31, n = pivots;
  set_identity(v, ldv, size);
  for (int k = n - 1; k >= 0; --k) {
    __syncthreads();
    // V(:, k) /= U(k, k); V(:, r) -= U(r, k) V(:, k) for r < k
    const T d = a[k * lda + k];
    T x[2];
    for (int h = 0; h < 2; ++h) x[h] = lane + 32 * h < n ? v[k * ldv + lane + 32 * h] / d : T(0);
    for (int r = warp; r < k; r += 4) {
      const T u = a[k * lda + r];
      if (u == T(0)) continue;
      for (int h = 0; h < 2; ++h)
        if (lane + 32 * h < n) v[r * ldv + lane + 32 * h] -= u * x[h];
    }
    __syncthreads();
    if (warp == 0)
      for (int h = 0; h < 2; ++h)
        if (lane + 32 * h < n) v[k * ldv + lane + 32 * h] = x[h];
  }
  __syncthreads();
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

/// \file
/// A diagonal tile of L U with partial pivoting, in shared memory, column-major, by one block of threads, in strips of
/// 16 columns: one warp eliminates a strip, a thread a column makes the rows beside it, and all warps update what is
/// left.
#pragma once

#include "device/cuda/kernels/diagonal.cuh"

namespace espalier::device::cuda {

/// M = identity (size x size).
template <class T>
__device__ inline void set_identity(T* m, int ldm, int size) {
  for_each_in_square(size, [&](int r, int c) { m[c * ldm + r] = r == c ? T(1) : T(0); });
}

/// 1 / x to one unit in the last place or two.
template <class T>
__device__ __forceinline__ T inverse_of(T x) {
  const T twice = 2 * x;
  return can_be_inverted_fast(twice) ? inverse_of_half(twice) : T(1) / x;
}

inline constexpr int kStripColumns = 16;

/// The columns of a strip that are not eliminated yet, in the registers of one warp; a lane holds row `lane` and, where
/// there are more than 32, row `lane + 32`. A step eliminates column 0 and moves the others one to the left, so that
/// all steps are the same code: what is unrolled over the columns of a tile is fetched from memory again and again.
template <class T>
struct Strip {
  T x[2][kStripColumns];

  /// @param a  the strip's first row and column
  __device__ __forceinline__ Strip(const T* a, int lda, int rows) {
    const int lane = static_cast<int>(threadIdx.x) & 31;
#pragma unroll
    for (int h = 0; h < 2; ++h)
#pragma unroll
      for (int c = 0; c < kStripColumns; ++c) x[h][c] = lane + 32 * h < rows ? a[c * lda + lane + 32 * h] : T(0);
  }

  /// x(:, c - 1) = x(:, c) - l row(c) for c = 1 .. kLeft; row(c) is the pivot row.
  template <int kLeft, class Row>
  __device__ __forceinline__ void eliminate(const T (&l)[2], bool two, Row&& row) {
    T u[kLeft];
#pragma unroll
    for (int c = 0; c < kLeft; ++c) u[c] = row(c + 1);
#pragma unroll
    for (int c = 0; c < kLeft; ++c) x[0][c] = fma(-l[0], u[c], x[0][c + 1]);
    if (!two) return;
#pragma unroll
    for (int c = 0; c < kLeft; ++c) x[1][c] = fma(-l[1], u[c], x[1][c + 1]);
  }
};

/// step(k, columns left) for the 16 columns of a strip: after eight, half of the registers have become free.
template <class Step>
__device__ __forceinline__ void for_each_step(Step&& step) {
#pragma unroll 1
  for (int k = 0; k < kStripColumns / 2; ++k) step.template operator()<kStripColumns - 1>(k);
#pragma unroll 1
  for (int k = kStripColumns / 2; k < kStripColumns; ++k) step.template operator()<kStripColumns / 2 - 1>(k);
}

/// column = inverse(L) column for 16 rows, L unit lower triangular, by one thread.
template <class T>
__device__ __forceinline__ void substitute_column(const T* l, int lda, T* column) {
  T x[16];
#pragma unroll
  for (int r = 0; r < 16; ++r) x[r] = column[r];
#pragma unroll
  for (int k = 0; k < 16; ++k)
#pragma unroll
    for (int r = k + 1; r < 16; ++r) x[r] = fma(-l[k * lda + r], x[k], x[r]);
#pragma unroll
  for (int r = 1; r < 16; ++r) column[r] = x[r];
}

/// to (16 x 16) -= left (16 x 16) right (16 x 16), by one warp; right(k, n) = right[k * rk + n * rn].
template <class T>
__device__ inline void subtract_product(T* to, int ldt, const T* left, int lda, const T* right, int rk, int rn) {
#pragma unroll
  for (int h = 0; h < 2; ++h) {
    T c[4] = {};
    multiply_shared(c, left, 1, lda, right + 8 * h * rn, rk, rn);
    put_shared(c, T(-1), true, to + 8 * h * ldt, 1, ldt);
  }
}

/// A replacement for a pivot that is too small; counts it. By one warp.
template <class T>
__device__ inline T acceptable_pivot(T d, T tiny, int k, const PivotSink<T>& sink) {
  const T magnitude = d < T(0) ? -d : d;
  if (magnitude >= tiny && magnitude != T(0)) return d;
  if (threadIdx.x == 0) {
    sink.state->replaced[sink.position + k] = 1;
    atomicAdd(sink.state->control + kReplaced, 1);
  }
  const T least = tiny > T(0) ? tiny : T(1e-30);
  return d < T(0) ? -least : least;
}

/// Where the rows of a tile have gone, in shared memory.
struct RowOrder {
  int source[64];  ///< of the strip: row r comes from source[r], both counted from the strip's first
  int origin[64];  ///< of all strips: row r of P A is row origin[r] of A
  int moved;       ///< the last strip has exchanged rows
};

/// A strip of L U with partial pivoting by one warp. Rows stay where they are: each holds its part of U from the column
/// on in which it is the pivot, and L before. Only pivots < `pivots` are eliminated; `first`: the strip's first
/// column in the tile.
template <class T>
__device__ void factor_strip_lu(T* a, int lda, int rows, int first, int pivots, const PivotSink<T>& sink,
                                RowOrder& order) {
  const int lane = static_cast<int>(threadIdx.x) & 31;
  const bool two = rows > 32;
  const T tiny = sink.state->tiny();
  Strip<T> p(a, lda, rows);
  int place[2] = {lane, lane + 32};
  bool waits[2] = {lane < rows, lane + 32 < rows};
  for_each_step([&]<int kLeft>(int k) {
    if (first + k >= pivots) return;
    unsigned key[2];
#pragma unroll
    for (int h = 0; h < 2; ++h) key[h] = waits[h] ? magnitude_key(p.x[h][0]) + 1 : 0;
    const unsigned best = largest_key(max(key[0], key[1]));
    const unsigned low = __ballot_sync(0xffffffffu, key[0] == best);
    const unsigned high = __ballot_sync(0xffffffffu, key[1] == best);
    const bool upper = low == 0;
    const int who = __ffs(static_cast<int>(upper ? high : low)) - 1;
    const T given = __shfl_sync(0xffffffffu, upper ? p.x[1][0] : p.x[0][0], who);
    const int from = __shfl_sync(0xffffffffu, upper ? place[1] : place[0], who);
    const T d = acceptable_pivot(given, tiny, first + k, sink);
    if (lane == 0) sink.state->pivot[sink.position + first + k] = from == k ? d : -d;
    const T inverse = inverse_of(d);
    T l[2];
#pragma unroll
    for (int h = 0; h < 2; ++h) {
      const bool chosen = lane == who && upper == (h == 1);
      l[h] = waits[h] && !chosen ? p.x[h][0] * inverse : T(0);
      place[h] = chosen ? k : place[h] == k ? from : place[h];
      if (waits[h]) a[k * lda + lane + 32 * h] = chosen ? d : l[h];
      if (chosen) {
#pragma unroll
        for (int c = 1; c <= kLeft; ++c)
          if (c < kStripColumns - k) a[(k + c) * lda + lane + 32 * h] = p.x[h][c];
      }
      waits[h] = waits[h] && !chosen;
    }
    __syncwarp();
    const T* row = a + k * lda + who + (upper ? 32 : 0);
    p.template eliminate<kLeft>(l, two, [&](int c) { return c < kStripColumns - k ? row[c * lda] : T(0); });
  });
  bool moved = false;
#pragma unroll
  for (int h = 0; h < 2; ++h) {
    const int r = lane + 32 * h;
    if (r >= rows) continue;
    order.source[place[h]] = r;
    moved = moved || place[h] != r;
  }
  moved = __any_sync(0xffffffffu, moved);
  if (lane == 0) order.moved = moved ? 1 : 0;
}

/// Brings the rows of `count` columns into their order; a warp takes every fourth. use(c): first of the rows.
template <class T, class Column>
__device__ inline void reorder_rows(const RowOrder& order, int rows, int count, Column&& column) {
  const int warp = static_cast<int>(threadIdx.x) >> 5, lane = static_cast<int>(threadIdx.x) & 31;
  const int s0 = lane < rows ? order.source[lane] : 0, s1 = lane + 32 < rows ? order.source[lane + 32] : 0;
  for (int c = warp; c < count; c += kThreads / 32) {
    T* x = column(c);
    const T v0 = x[s0], v1 = x[s1];
    __syncwarp();
    if (lane < rows) x[lane] = v0;
    if (lane + 32 < rows) x[lane + 32] = v1;
  }
}

/// order.origin after a strip from row `first` on has moved rows; by one warp.
__device__ inline void reorder_origin(RowOrder& order, int first, int rows) {
  const int lane = static_cast<int>(threadIdx.x) & 31;
  int from[2];
  for (int h = 0; h < 2; ++h) from[h] = lane + 32 * h < rows ? order.origin[first + order.source[lane + 32 * h]] : 0;
  __syncwarp();
  for (int h = 0; h < 2; ++h)
    if (lane + 32 * h < rows) order.origin[first + lane + 32 * h] = from[h];
}

/// M = M P: column c becomes column origin[c]. Starts with a barrier.
template <class T>
__device__ inline void reorder_columns(const RowOrder& order, T* m, int ldm, int size) {
  const int warp = static_cast<int>(threadIdx.x) >> 5, lane = static_cast<int>(threadIdx.x) & 31;
  T x[16][2];
  __syncthreads();
#pragma unroll
  for (int j = 0; j < 16; ++j)
#pragma unroll
    for (int h = 0; h < 2; ++h)
      if (warp + 4 * j < size && lane + 32 * h < size) x[j][h] = m[(warp + 4 * j) * ldm + lane + 32 * h];
  __syncthreads();
#pragma unroll
  for (int j = 0; j < 16; ++j)
#pragma unroll
    for (int h = 0; h < 2; ++h)
      if (warp + 4 * j < size && lane + 32 * h < size) m[order.origin[warp + 4 * j] * ldm + lane + 32 * h] = x[j][h];
}

/// M = inverse(L) P with P A = L U by partial pivoting; U is left in the upper triangle of A, whose padding becomes
/// that of the identity.
template <class T>
__device__ inline void invert_lower_lu(T* a, int lda, int size, int pivots, T* m, int ldm, const PivotSink<T>& sink) {
  __shared__ RowOrder order;
  const int warp = static_cast<int>(threadIdx.x) >> 5, blocks = size / 16;
  set_identity(m, ldm, size);
  if (threadIdx.x < 64) order.origin[threadIdx.x] = threadIdx.x;
  if (pivots < size)
    for_each_in_square(size, [&](int r, int c) {
      if (max(r, c) >= pivots) a[c * lda + r] = r == c ? T(1) : T(0);
    });
  __syncthreads();
  bool moved = false;
  for (int p = 0; p < blocks; ++p) {
    const int first = 16 * p, rows = size - first;
    T* strip = a + first * (lda + 1);
    if (warp == 0) factor_strip_lu(strip, lda, rows, first, pivots, sink, order);
    __syncthreads();
    // Columns of M to the left of the strip, and of A from the strip on: `size` in all.
    const auto column = [&](int c) { return (c < first ? m + c * ldm : a + c * lda) + first; };
    if (order.moved != 0) {
      moved = true;
      reorder_rows<T>(order, rows, size, column);
      if (warp == 0) reorder_origin(order, first, rows);
      __syncthreads();
    }
    if (const int c = static_cast<int>(threadIdx.x); c < size)  // the rows of the strip: M(p, :) and U(p, :)
      substitute_column(strip, lda, c < first + 16 ? m + c * ldm + first : column(c));
    __syncthreads();
    for (int x = warp; x < (blocks - 1 - p) * blocks; x += 4) {
      const int i = p + 1 + x / blocks, j = x % blocks;
      const T* left = a + first * lda + 16 * i;
      T* to = j > p ? a + 16 * j * lda : m + 16 * j * ldm;
      const int ldt = j > p ? lda : ldm;
      subtract_product(to + 16 * i, ldt, left, lda, to + first, 1, ldt);
    }
    __syncthreads();
  }
  if (moved) {
    reorder_columns(order, m, ldm, size);
    __syncthreads();
  }
}

/// V = transpose of inverse(U), lower triangular, from the upper triangle of A. Blocks of 16 x 16: those of the
/// diagonal by substitution, V(i, j) = -V(i, i) sum over j <= k < i of U(k, i)^T V(k, j).
template <class T>
__device__ inline void invert_upper_lu(const T* a, int lda, int size, T* v, int ldv) {
  const int warp = static_cast<int>(threadIdx.x) >> 5, lane = static_cast<int>(threadIdx.x) & 31, blocks = size / 16;
  set_identity(v, ldv, size);
  __syncthreads();
  if (warp < blocks && lane < 16) {
    const T* u = a + 16 * warp * (lda + 1);
    T* column = v + (16 * warp + lane) * ldv + 16 * warp;
    T x[16];
    const T mine = T(1) / u[lane * lda + lane];
#pragma unroll
    for (int r = 0; r < 16; ++r) x[r] = r == lane ? T(1) : T(0);
#pragma unroll
    for (int k = 0; k < 16; ++k) {
      x[k] *= __shfl_sync(0x0000ffffu, mine, k);
#pragma unroll
      for (int r = k + 1; r < 16; ++r) x[r] = fma(-u[r * lda + k], x[k], x[r]);
    }
#pragma unroll
    for (int r = 0; r < 16; ++r) column[r] = x[r];
  }
  for (int away = 1; away < blocks; ++away) {
    __syncthreads();
    const int j = warp, i = j + away;
    if (i >= blocks) continue;
    T* to = v + 16 * j * ldv + 16 * i;
    T c[2][4] = {};
    for (int k = j; k < i; ++k)
      for (int h = 0; h < 2; ++h)
        multiply_shared(c[h], a + 16 * i * lda + 16 * k, lda, 1, v + (16 * j + 8 * h) * ldv + 16 * k, 1, ldv);
    for (int h = 0; h < 2; ++h) put_shared(c[h], T(1), false, to + 8 * h * ldv, 1, ldv);
    __syncwarp();
    T e[2][4] = {};
    for (int h = 0; h < 2; ++h) multiply_shared(e[h], v + 16 * i * (ldv + 1), 1, ldv, to + 8 * h * ldv, 1, ldv);
    __syncwarp();
    for (int h = 0; h < 2; ++h) put_shared(e[h], T(-1), false, to + 8 * h * ldv, 1, ldv);
  }
  __syncthreads();
}

}  // namespace espalier::device::cuda

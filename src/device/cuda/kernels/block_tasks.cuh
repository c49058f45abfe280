/// \file
/// The tasks of row blocks: the sums of products that belong to them, products with the inverse of the diagonal tile or
/// with D, and the ways to their places. Each task is carried out by one block of threads; all of its shared memory is
/// one area that serves in turn as scratch for assembly, as pipeline, and as operands of the last product.
#pragma once

#include "device/cuda/kernels/half_products.cuh"

namespace espalier::device::cuda {

/// acc = acc D^-1 for the pivots of tile column j, which other blocks have made. Starts and ends with a barrier.
template <class T, class S>
__device__ void multiply_by_inverse_d(Accumulator<T, S>& acc, const FactorState<T>& s, T* area, int position,
                                      int pivots) {
  const Corner<S> at;
  const int k = threadIdx.x;
  const bool mine = k < pivots && k < S::kWidth;
  const T dk = mine ? __ldcg(s.inverse_d + position + k) : T(0), ek = mine ? __ldcg(s.inverse_e + position + k) : T(0);
  const bool pairs = __syncthreads_or(ek != T(0)) != 0;
  T* d = area + S::kLd * S::kWidth;
  T* e = d + S::kWidth;
  if (k < S::kWidth) {
    d[k] = dk;
    e[k] = ek;
  }
  if (pairs) for_each_element<S>(at, [&](int m, int n, int u, int r, int c) { area[c * S::kLd + r] = acc[m][n][u]; });
  __syncthreads();
  if (pairs)
    for_each_element<S>(at, [&](int m, int n, int u, int r, int c) {
      acc[m][n][u] = apply_inverse_d(d, e, c, [&](int x) { return area[x * S::kLd + r]; });
    });
  else
    for_each_element<S>(at, [&](int m, int n, int u, int, int c) { acc[m][n][u] *= d[c]; });
}

/// acc = X M^T with X = -acc, through the area; M is the inverse of the diagonal tile, `cols` wide, at `inverse`.
template <class T, class S>
__device__ void multiply_by_inverse(Accumulator<T, S>& acc, Workshop<T>& w, const T* inverse, std::int64_t chunk_stride,
                                    int rows, int cols, const int* flag) {
  const Corner<S> at;
  const FactorState<T>& s = *w.state;
  T* x = w.pipe.stages;
  T* m = x + S::kRows * S::kWidth;
  if (threadIdx.x == 0) w.feed->waited += wait_for(flag, 1, s.control, s.patience);
#if ESPALIER_BULK_COPIES
  if (threadIdx.x == 0) {
    fence_shared();
    fence_global();
    barrier_expect(w.pipe.barriers, cols * cols * sizeof(T));
    for (int q = 0; q < cols / kChunk; ++q)
      bulk_copy(m + q * cols * kChunk, inverse + q * chunk_stride, cols * kChunk * sizeof(T), w.pipe.barriers);
  }
#else
  __syncthreads();
  for (int y = threadIdx.x; y < cols * cols; y += kThreads)
    m[y] = inverse[y / (cols * kChunk) * chunk_stride + y % (cols * kChunk)];
#endif
  store_panels<T, S>(acc, T(-1), x, S::kRows * kChunk, rows, cols, at);
#pragma unroll
  for (int i = 0; i < S::kM; ++i)
#pragma unroll
    for (int j = 0; j < S::kN; ++j)
#pragma unroll
      for (int e = 0; e < 4; ++e) acc[i][j][e] = T(0);
#if ESPALIER_BULK_COPIES
  w.pipe.wait(0);
#endif
  __syncthreads();
  Products<T, SplitFormat::tf32, S> products(acc, {1, 1});  // an inverse may be large
  if (at.row < rows && at.col < cols)
    for (int q = 0; q < cols / kChunk; ++q) products.add(x + q * S::kRows * kChunk, m + q * cols * kChunk, at);
  products.finish();
}

/// Writes -acc column-major: `height` rows and `width` columns, or S::kWidth, from accumulators [.][first] on.
template <class T, class S>
__device__ __forceinline__ void store_columns(const Accumulator<T, S>& acc, int first, T* to, std::int64_t ld,
                                              int height, int width, const Corner<S>& at) {
  const int r = at.row + (at.lane >> 2), c = 2 * (at.lane & 3);
  T* column = to + c * ld + r;
#pragma unroll
  for (int n = 0; n < S::kWidth / 8; ++n, column += 8 * ld)
#pragma unroll
    for (int u = 0; u < 2; ++u)
#pragma unroll
      for (int m = 0; m < S::kM; ++m)
#pragma unroll
        for (int h = 0; h < 2; ++h)
          if (r + S::kRowStep * m + 8 * h < height && c + 8 * n + u < width)
            column[u * ld + S::kRowStep * m + 8 * h] = -acc[m][first + n][2 * h + u];
}

/// Where tile column j of the contribution begins, with its first row.
template <class T>
__device__ inline T* contribution_column(const Workshop<T>& w, const Front& f, int j, int part) {
  const int b = j - f.pivot_tiles, first = b * f.width;
  if (f.first_place >= 0) return w.state->places[f.place(b, part)];
  return w.base() + (part == 0 ? f.contribution : f.contribution_up) + f.contribution_offset(first, first);
}

/// Where a row block's part of a pivot column stands in an array of the front.
template <class T>
struct PivotPlace {
  T* to;
  std::int64_t stride;  ///< from chunk to chunk
};
template <class T>
__device__ inline PivotPlace<T> pivot_place(T* array, const Front& f, int j, int row) {
  return {array + f.chunk_offset(f.column_begin(j) / kChunk, row),
          static_cast<std::int64_t>(f.total_pad - j * f.width) * kChunk};
}

/// acc = the part of L (or U^T) in pivot column j, whose sum has been taken, and into its place; of L D L^T L D, too.
/// @returns its place
template <class T, Kind K, class S>
__device__ __forceinline__ PivotPlace<T> make_pivot_block(Workshop<T>& w, const Front& f, Accumulator<T, S>& acc, int j,
                                                          int part, RowRange r, unsigned peers) {
  const FactorState<T>& s = *w.state;
  const Corner<S> at;
  const int col = f.column_begin(j), cols = f.column_end(j) - col;
  const int inverse = K == Kind::lu ? 1 - part : 0;  // L = C inverse(U), U^T = C P^T inverse(L)^T
  const PivotPlace<T> diagonal = pivot_place(array_of(w.base(), f, inverse), f, j, col);
  multiply_by_inverse<T, S>(acc, w, diagonal.to, diagonal.stride, r.rows, cols, s.flags(0) + f.diagonal_flag(j));
  if constexpr (K == Kind::ldlt) {
    const PivotPlace<T> second = pivot_place(array_of(w.base(), f, 1), f, j, r.row);
    store_panels<T, S>(acc, T(1), second.to, second.stride, r.rows, cols, at);
    for_each_device(peers, [&](int d) {
      store_panels<T, S>(acc, T(1), s.peers.top[d] + (second.to - w.base()), second.stride, r.rows, cols, at);
    });
    multiply_by_inverse_d<T, S>(acc, s, w.pipe.stages, f.position + col, f.pivots - col);
  }
  if constexpr (K != Kind::llt) {
    const T bound = s.growth();
    if (part == 0)
      for_each_element<S>(at, [&](int m, int n, int e, int row, int c) {
        if (row < r.rows && col + c < f.pivots && c < cols) check_growth(s, bound, acc[m][n][e], f.position + col + c);
      });
  }
  const PivotPlace<T> place = pivot_place(array_of(w.base(), f, part), f, j, r.row);
  store_panels<T, S>(acc, T(1), place.to, place.stride, r.rows, cols, at);
  return place;
}

/// Stores a part of a pivot column to device d, too.
template <class T, class S>
__device__ __forceinline__ void push_pivot_block(const Workshop<T>& w, const Front& f, const Accumulator<T, S>& acc,
                                                 int j, RowRange r, const PivotPlace<T>& place, int d) {
  store_panels<T, S>(acc, T(1), w.state->peers.top[d] + (place.to - w.base()), place.stride, r.rows,
                     f.column_end(j) - f.column_begin(j), Corner<S>());
}

/// The sum that a task takes: of rows r times `cols` rows from `col` on, when the flags of row blocks a and b are set.
template <class T, Kind K>
__device__ __forceinline__ ChunkSum<T> sum_of_block(const Workshop<T>& w, const Front& f, RowRange r, int col, int cols,
                                                    int a, int b, int part, int chunks) {
  const FactorState<T>& s = *w.state;
  const int from_a = operand_array<K>(part, 0), from_b = operand_array<K>(part, 1);
  return {&f,
          {array_of(w.base(), f, from_a), r.row, r.rows},
          {array_of(w.base(), f, from_b), col, cols},
          false,
          chunks,
          s.flags(K == Kind::lu ? from_a : 0) + f.flag(a, 0),
          s.flags(K == Kind::lu ? from_b : 0) + f.flag(b, 0),
          f.blocks};
}

/// See Work::two_columns. Larger blocks read each operand less often. The second one of two pivot columns takes the
/// products with the first one when that is made.
template <class T, Kind K, int Width>
__device__ __forceinline__ void two_columns_task(Workshop<T>& w, const Front& f, const FactorTask& task, bool any) {
  using S = Shape<T, 128, Width, 2>;
  using One = Shape<T, 128, Width>;
  const FactorState<T>& s = *w.state;
  const int j = task.column, a = task.block, b = f.block_of_column(j), part = task.part;
  const bool pivot = j < f.pivot_tiles;
  const int col = f.column_begin(j), cols = f.column_end(j + 1) - col;
  const RowRange r = rows_of(f, task);
  const HalfScales scales = operand_scales<K>(s.largest(), s.growth(), part);
  T acc[S::kM][S::kN][4];
  ChunkSum<T> sum = sum_of_block<T, K>(w, f, r, col, cols, a, b, part, (pivot ? col : f.pivot_pad) / kChunk);
  sum_tile<false, T, S>(acc, w, sum, any, 0, scales);
  if (!pivot) {
    const Corner<S> at;
    const int below_row = r.row - f.pivot_pad, below_col = col - f.pivot_pad;
    const int height = min(r.rows, f.below - below_row), width = min(cols, f.below - below_col);
    const std::int64_t ld = f.below_ld - below_col;
    T* const to = contribution_column(w, f, j, part) + (below_row - below_col);
    store_columns<T, S>(acc, 0, to, ld, height, width, at);
    T* const next = contribution_column(w, f, j + 1, part) + (below_row - below_col - Width);
    store_columns<T, S>(acc, S::kN / 2, next, ld - Width, height, width - Width, at);
    finish_task(w, task.front, f.flag(a, j), part, f.blocks, waiting_peers(s, f, true), [](int) {});
    return;
  }
  T one[One::kM][One::kN][4], other[One::kM][One::kN][4];
#pragma unroll
  for (int m = 0; m < One::kM; ++m)
#pragma unroll
    for (int n = 0; n < One::kN; ++n)
#pragma unroll
      for (int e = 0; e < 4; ++e) {
        one[m][n][e] = acc[m][n][e];
        other[m][n][e] = acc[m][One::kN + n][e];
      }
  const unsigned peers = waiting_peers(s, f, false);
  PivotPlace<T> place = make_pivot_block<T, K, One>(w, f, one, j, part, r, peers);
  fence_shared();
  fence_global();
  set_flags(s, f.flag(a, j), part, 0, peers, nullptr,
            [&](int d) { push_pivot_block<T, One>(w, f, one, j, r, place, d); });
  sum = sum_of_block<T, K>(w, f, r, col + Width, cols - Width, a, b, part, Width / kChunk);
  sum.first = col / kChunk;
  sum.flag_a += static_cast<std::int64_t>(j) * f.blocks;
  sum.flag_b += static_cast<std::int64_t>(j) * f.blocks;
  sum_products<T, One>(other, sum, w.pipe, s.control, s.patience, scales);
  place = make_pivot_block<T, K, One>(w, f, other, j + 1, part, r, peers);
  finish_task(w, task.front, f.flag(a, j + 1), part, 0, peers,
              [&](int d) { push_pivot_block<T, One>(w, f, other, j + 1, r, place, d); });
}

/// One row block of a tile column, in S::kRows x S::kWidth at most.
template <class T, Kind K, bool Half, class S>
__device__ __forceinline__ void block_task(Workshop<T>& w, const Front& f, const FactorTask& task, bool any) {
  const FactorState<T>& s = *w.state;
  const Corner<S> at;
  const int j = task.column, a = task.block, part = task.part;
  const bool pivot = j < f.pivot_tiles;
  const int col = f.column_begin(j), cols = f.column_end(j) - col;
  const RowRange r = rows_of(f, task);
  T acc[S::kM][S::kN][4];
  const ChunkSum<T> sum =
      sum_of_block<T, K>(w, f, r, col, cols, a, f.block_of_column(j), part, (pivot ? col : f.pivot_pad) / kChunk);
  sum_tile<Half, T, S>(acc, w, sum, any, r.row - col, operand_scales<K>(s.largest(), s.growth(), part));
  if (!pivot) {
    const int r0 = r.row - f.pivot_pad, c0 = col - f.pivot_pad;
    const std::int64_t ld = f.below_ld - c0;
    T* to = contribution_column(w, f, j, part);
    for_each_element<S>(at, [&](int m, int n, int e, int row, int c) {
      if (row < r.rows && c < cols && r0 + row < f.below && c0 + c < f.below && r0 + row >= c0 + c)
        to[c * ld + (r0 - c0) + row] = -acc[m][n][e];
    });
    finish_task(w, task.front, f.flag(a, j), part, 0, waiting_peers(s, f, true), [](int) {});
  } else {
    const unsigned peers = waiting_peers(s, f, false);
    const PivotPlace<T> place = make_pivot_block<T, K, S>(w, f, acc, j, part, r, peers);
    finish_task(w, task.front, f.flag(a, j), part, 0, peers,
                [&](int d) { push_pivot_block<T, S>(w, f, acc, j, r, place, d); });
  }
}

}  // namespace espalier::device::cuda

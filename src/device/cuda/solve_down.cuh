/// \file
/// Backward substitution for one right-hand side: one row block of the pivots of a front.
#pragma once

#include "device/cuda/solve_bench.cuh"

namespace espalier::device::cuda {

namespace {

/// Place of padded row r of the front in the solution; -1 for padding.
template <class T>
__device__ inline int position_of_row(const SolveState<T>& s, const Front& f, int r) {
  if (r < f.pivot_pad) return r < f.pivots ? f.position + r : -1;
  return r - f.pivot_pad < f.below ? s.rows[f.rows + r - f.pivot_pad] : -1;
}

/// v -= L(rows from `from` on, columns of the block)^T x, from the last group of 128 rows up: what is known first comes
/// first. A warp has 16 columns, or, where there are too few, half or a quarter of every group's rows of them. AtOnce:
/// panels that a warp has on their way (see kChunksAtOnce).
template <int AtOnce, class T, int R>
__device__ void subtract_below(const SolveState<T>& s, SolveBench<T, R>& b, const T* factor, int col, int cols,
                               int from) {
  const Front& f = b.front;
  const int lane = lane_of_thread(), g = lane >> 2, t = lane & 3;
  constexpr int kPerGroup = kRowBlock / kPanel, kMostParts = kPerGroup / AtOnce;
  const int panels = (f.total_pad - from) / kPanel;
  if (panels == 0) return;
  const int room = warps() * kChunk / cols;
  const int parts = room >= 4 && kMostParts >= 4 ? 4 : (room >= 2 ? 2 : 1);
  const int each = warps() / parts, warp = warp_of_thread() % each, part = warp_of_thread() / each;
  const int span = kPerGroup / parts, low = part * span;
  const bool mine = warp * kChunk < cols;
  const T* base = factor + f.chunk_offset(col / kChunk + (mine ? warp : 0), from) + lane * 2;
  T acc[4] = {};
  PairOf<T> l[AtOnce][2] = {};  // defined from the start: see for_each_piece()
  const auto load = [&](int p0) {
    if (!mine || p0 < 0) return;
    const T* at = base + static_cast<std::int64_t>(p0) * 128;
#pragma unroll
    for (int p = 0; p < AtOnce; ++p)
#pragma unroll
      for (int h = 0; h < 2; ++h) l[p][h] = p0 + p < panels ? stream_pair(at + p * 128 + h * 64) : PairOf<T>{};
  };
  const int groups = (panels + kPerGroup - 1) / kPerGroup;
  load((groups - 1) * kPerGroup + low + span - AtOnce);
  for (int k = groups - 1; k >= 0; --k) {
    T* x = b.x + (k & 1) * kRowBlock;
    for (int y = threadIdx.x; y < kRowBlock; y += threads()) {
      const int r = from + k * kRowBlock + y, at = r < f.total_pad ? position_of_row(s, f, r) : -1;
      x[y] = at >= 0 ? await(s.solution + at, s.control, s.patience) : T(0);
    }
    __syncthreads();
    if (!mine) continue;
#pragma unroll 1
    for (int p0 = low + span - AtOnce; p0 >= low; p0 -= AtOnce) {
#pragma unroll
      for (int p = 0; p < AtOnce; ++p) {
        const T z = x[(p0 + p) * kPanel + g];
        acc[0] += l[p][0].x * z;
        acc[1] += l[p][0].y * z;
        acc[2] += l[p][1].x * z;
        acc[3] += l[p][1].y * z;
      }
      load(p0 > low ? k * kPerGroup + p0 - AtOnce : (k - 1) * kPerGroup + low + span - AtOnce);
    }
  }
  if (parts > 1) __syncthreads();
  T* to = parts > 1 ? b.x + part * cols : b.v;
#pragma unroll
  for (int u = 0; u < 4; ++u) {
    const T sum = sum_over_rows(acc[u]);
    T& at = to[warp * kChunk + 4 * u + t];
    if (mine && g == 0) at = parts > 1 ? sum : at - sum;
  }
  if (parts == 1) return;
  __syncthreads();
  for (int y = threadIdx.x; y < cols; y += threads()) {
    T sum = b.x[y];
    for (int p = 1; p < parts; ++p) sum += b.x[p * cols + y];
    b.v[y] -= sum;
  }
}

/// Partial sums of columns [col, col_end) of a block times the values of its rows [row, row_end), each column from its
/// tile's first row on: part[h * (col_end - col) + ...] over half h of the panels. value(r): of row r.
template <class T, class Value>
__device__ void multiply_columns(const BlockView<T>& a, int row, int row_end, int col, int col_end, T* part,
                                 Value&& value) {
  const int lane = lane_of_thread(), g = lane >> 2, t = lane & 3;
  for_each_in_turns(2 * (col_end - col) / kChunk, [&](int unit) {
    const int c = col + (unit >> 1) * kChunk, h = unit & 1, first = max(row, a.tile_begin(c));
    const int panels = (row_end - first) / kPanel, half = (panels + 1) / 2, end = h == 0 ? half : panels;
    const T* from = a.panels(c, first) + lane * 2;
    T acc[4] = {};
    for_each_piece(h * half, end, [&](auto pieces, int p0) {
      constexpr int kPieces = decltype(pieces)::value;
      PairOf<T> l[kPieces][2];
#pragma unroll
      for (int p = 0; p < kPieces; ++p)
#pragma unroll
        for (int k = 0; k < 2; ++k) l[p][k] = load_pair(from + (p0 + p) * 128 + k * 64);
#pragma unroll
      for (int p = 0; p < kPieces; ++p) {
        const T z = value(first + kPanel * (p0 + p) + g);
        acc[0] += l[p][0].x * z;
        acc[1] += l[p][0].y * z;
        acc[2] += l[p][1].x * z;
        acc[3] += l[p][1].y * z;
      }
    });
#pragma unroll
    for (int u = 0; u < 4; ++u) {
      const T sum = sum_over_rows(acc[u]);
      if (g == 0) part[h * (col_end - col) + (c - col) + 4 * u + t] = sum;
    }
  });
}

/// v = the forward solution of the block, times D^-1 for ldlt; zero in the padding.
template <class T, int R>
__device__ void take_forward(const SolveState<T>& s, SolveBench<T, R>& b, int col, int cols) {
  const Front& f = b.front;
  for (int y = threadIdx.x; y < kRowBlock; y += threads()) {
    const bool real = y < cols && col + y < f.pivots;
    const T v = real ? await(s.forward + f.position + col + y, s.control, s.patience) : T(0);
    (s.inverse_d != nullptr ? b.y : b.v)[y] = v;
  }
  if (s.inverse_d == nullptr) return;
  __syncthreads();
  for (int k = threadIdx.x; k < kRowBlock; k += threads()) {
    const int position = f.position + col + k;
    T v = T(0);
    if (k < cols && col + k < f.pivots) {
      v = s.inverse_d[position] * b.y[k];
      const T e = s.inverse_e[position];
      if (e != T(0)) v += e * b.y[k + 1];
      const T before = col + k > 0 ? s.inverse_e[position - 1] : T(0);
      if (before != T(0) && k > 0) v += before * b.y[k - 1];
    }
    b.v[k] = v;
  }
}

/// One row block of pivots. parity: of the barrier of what is kept; AtOnce: see subtract_below().
template <int AtOnce, class T, int R>
__device__ void go_down(const SolveState<T>& s, SolveBench<T, R>& b, int a, unsigned& parity) {
  const Front& f = b.front;
  const int col = f.block_begin(a), end = f.block_end(a), cols = end - col;
  const T* factor = s.base[f.region] + (s.down_second ? f.second : f.factor);
  keep_block(b, factor, col, end, end);
#pragma unroll 1
  for (int q = 0; q < cols / kChunk; ++q)  // what waits for the block above
    prefetch(factor + f.chunk_offset(col / kChunk + q, end), (min(end + kRowBlock, f.total_pad) - end) * kChunk);
  take_forward(s, b, col, cols);
  __syncthreads();
  subtract_below<AtOnce>(s, b, factor, col, cols, end);
  await_kept(b, parity);
  __syncthreads();
  const BlockView<T> block = view_block(b, factor, col, end);
  for (int c0 = (cols - 1) / f.inverted * f.inverted; c0 >= 0; c0 -= f.inverted) {
    const int c1 = min(c0 + f.inverted, cols), size = c1 - c0;
    const bool more = c1 < cols;
    const T* left = b.x;                   // partial sums over the rows of the block after these columns
    T* own = b.x + (more ? 2 * size : 0);  // partial sums of the product with the inverse
    if (more) {
      multiply_columns(block, c1, cols, c0, c1, b.x, [&](int r) { return b.y[r]; });
      __syncthreads();
    }
    multiply_columns(block, c0, c1, c0, c1, own,
                     [&](int r) { return more ? b.v[r] - (left[r - c0] + left[size + r - c0]) : b.v[r]; });
    __syncthreads();
    for (int y = threadIdx.x; y < size; y += threads()) {
      const T value = own[y] + own[size + y];
      const int r = col + c0 + y;
      b.y[c0 + y] = value;
      if (r >= f.pivots) continue;
      publish(s.solution + f.position + r, value);
      if (s.speaks_for(f)) s.result[static_cast<std::int64_t>(f.position + r) * s.columns + s.first_column] = value;
    }
    if (c0 > 0) __syncthreads();
  }
}

}  // namespace

}  // namespace espalier::device::cuda

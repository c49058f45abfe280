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
/// first. A warp has 16 columns, or, where there are too few, half or a quarter of every group's rows of them.
template <class T, int R>
__device__ void subtract_below(const SolveState<T>& s, SolveBench<T, R>& b, const T* factor, int col, int cols,
                               int from) {
  const Front& f = b.front;
  const int lane = lane_of_thread(), g = lane >> 2, t = lane & 3;
  constexpr int kAtOnce = 4;  // panels in registers
  constexpr int kPerGroup = kRowBlock / kPanel;
  const int panels = (f.total_pad - from) / kPanel;
  if (panels == 0) return;
  const int parts = 4 * cols <= warps() * kChunk ? 4 : (2 * cols <= warps() * kChunk ? 2 : 1);
  const int each = warps() / parts, warp = warp_of_thread() % each, part = warp_of_thread() / each;
  const int span = kPerGroup / parts, low = part * span;
  const bool mine = warp * kChunk < cols;
  const T* base = factor + f.chunk_offset(col / kChunk + (mine ? warp : 0), from) + lane * 2;
  T acc[4] = {};
  PairOf<T> l[kAtOnce][2];
  const auto load = [&](int p0) {
    if (!mine || p0 < 0) return;
#pragma unroll
    for (int p = 0; p < kAtOnce; ++p)
#pragma unroll
      for (int h = 0; h < 2; ++h)
        l[p][h] = stream_pair(base + static_cast<std::int64_t>(min(p0 + p, panels - 1)) * 128 + h * 64);
  };
  const int groups = (panels + kPerGroup - 1) / kPerGroup;
  load((groups - 1) * kPerGroup + low + span - kAtOnce);
  for (int k = groups - 1; k >= 0; --k) {
    T* x = b.x + (k & 1) * kRowBlock;
    for (int y = threadIdx.x; y < kRowBlock; y += threads()) {
      const int r = from + k * kRowBlock + y, at = r < f.total_pad ? position_of_row(s, f, r) : -1;
      x[y] = at >= 0 ? await(s.solution + at, s.control, s.patience) : T(0);
    }
    __syncthreads();
    if (!mine) continue;
#pragma unroll 1
    for (int p0 = low + span - kAtOnce; p0 >= low; p0 -= kAtOnce) {
#pragma unroll
      for (int p = 0; p < kAtOnce; ++p) {
        const T z = x[(p0 + p) * kPanel + g];
        acc[0] += l[p][0].x * z;
        acc[1] += l[p][0].y * z;
        acc[2] += l[p][1].x * z;
        acc[3] += l[p][1].y * z;
      }
      load(p0 > low ? k * kPerGroup + p0 - kAtOnce : (k - 1) * kPerGroup + low + span - kAtOnce);
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

/// Partial sums of A^T in for `rows` x `cols` (at most 64) panels of a tile column: part[h * 64 + ...] over the panels
/// of half h. value(r): element of `in`.
template <class T, class Value>
__device__ void multiply_panels_transposed(const TileColumn<T>& a, int rows, int cols, T* part, Value&& value) {
  const int lane = lane_of_thread(), g = lane >> 2, t = lane & 3;
  const int chunks = cols / kChunk, panels = rows / kPanel, half = (panels + 1) / 2;
  for (int unit = warp_of_thread(); unit < 2 * chunks; unit += warps()) {
    const int q = unit >> 1, h = unit & 1, end = h == 0 ? half : panels;
    const T* from = a.at + q * a.stride + lane * 2;
    T acc[4] = {};
    for (int p0 = h * half; p0 < end; p0 += 4) {
      PairOf<T> l[4][2];
#pragma unroll
      for (int p = 0; p < 4; ++p)
        if (p0 + p < end) {
          l[p][0] = load_pair(from + (p0 + p) * 128);
          l[p][1] = load_pair(from + (p0 + p) * 128 + 64);
        }
#pragma unroll
      for (int p = 0; p < 4; ++p)
        if (p0 + p < end) {
          const T z = value(kPanel * (p0 + p) + g);
          acc[0] += l[p][0].x * z;
          acc[1] += l[p][0].y * z;
          acc[2] += l[p][1].x * z;
          acc[3] += l[p][1].y * z;
        }
    }
#pragma unroll
    for (int u = 0; u < 4; ++u) {
      const T sum = sum_over_rows(acc[u]);
      if (g == 0) part[h * 64 + q * kChunk + 4 * u + t] = sum;
    }
  }
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

/// One row block of pivots. parity: of the barrier of what is kept.
template <class T, int R>
__device__ void go_down(const SolveState<T>& s, SolveBench<T, R>& b, int a, unsigned& parity) {
  const Front& f = b.front;
  const int col = f.block_begin(a), end = f.block_end(a), cols = end - col;
  const int per_block = kRowBlock / f.width, tile = a * per_block;
  const T* factor = s.base[f.region] + (s.down_second ? f.second : f.factor);
  keep_block(b, factor, col, end, end);
  for (int q = 0; q < cols / kChunk; ++q)  // what waits for the block above
    prefetch(factor + f.chunk_offset(col / kChunk + q, end), (min(end + kRowBlock, f.total_pad) - end) * kChunk);
  take_forward(s, b, col, cols);
  __syncthreads();
  subtract_below(s, b, factor, col, cols, end);
  await_kept(b, parity);
  __syncthreads();
  T* left = b.x;          // partial sums over the rows of the block after the tile
  T* own = b.x + 2 * 64;  // partial sums of the product with the inverse
  for (int j = min(tile + per_block, f.pivot_tiles) - 1; j >= tile; --j) {
    const int c0 = f.column_begin(j), c1 = f.column_end(j), size = c1 - c0;
    const TileColumn<T> l = tile_column(b, factor, col, end, j);
    const bool more = c1 < end;
    const T* v = b.v + (c0 - col);
    const T* x = b.y + (c1 - col);
    if (more) {
      multiply_panels_transposed<T>({l.at + size * kChunk, l.stride}, end - c1, size, left,
                                    [&](int r) { return x[r]; });
      __syncthreads();
    }
    multiply_panels_transposed<T>(l, size, size, own,
                                  [&](int r) { return more ? v[r] - (left[r] + left[64 + r]) : v[r]; });
    __syncthreads();
    const int real = min(size, f.pivots - c0);
    for (int y = threadIdx.x; y < size; y += threads()) {
      const T value = own[y] + own[64 + y];
      b.y[c0 - col + y] = value;
      if (y >= real) continue;
      publish(s.solution + f.position + c0 + y, value);
      if (s.speaks_for(f))
        s.result[static_cast<std::int64_t>(f.position + c0 + y) * s.columns + s.first_column] = value;
    }
    __syncthreads();
  }
}

}  // namespace

}  // namespace espalier::device::cuda

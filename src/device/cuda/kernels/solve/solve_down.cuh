/// \file
/// Backward substitution for one right-hand side: one row block of the pivots of a front.
#pragma once

#include "device/cuda/kernels/solve/solve_bench.cuh"

namespace espalier::device::cuda {

namespace {

/// Place of padded row r of the front in the solution; -1 for padding.
template <class T>
__device__ inline int position_of_row(const SolveState<T>& s, const Front& f, int r) {
  if (r < f.pivot_pad) return r < f.pivots ? f.position + r : -1;
  return r - f.pivot_pad < f.below ? s.rows[f.rows + r - f.pivot_pad] : -1;
}

/// Panels of the rows below a block of pivots in registers, from the last group of 128 rows up: what is known first
/// comes first. A warp has 16 columns, or, where there are too few, half or a quarter of every group's rows of them.
/// N: panels that a warp has on their way (see kChunksAtOnce).
template <class T, int N>
struct BelowPanels {
  static constexpr int kPerGroup = kRowBlock / kPanel;
  PairOf<T> l[N][2] = {};                    ///< defined from the start: see for_each_unrolled()
  int panels, parts, warp, part, low, high;  ///< of the rows; of a group; this warp's columns, part, and panels of it
  bool mine;

  /// from: first row
  __device__ BelowPanels(const Front& f, const T* factor, int col, int cols, int from) {
    panels = (f.total_pad - from) / kPanel;
    const int room = warps() * kChunk / cols;
    parts = room >= 4 && kPerGroup / N >= 4 ? 4 : (room >= 2 ? 2 : 1);
    const int each = warps() / parts, span = kPerGroup / parts;
    warp = warp_of_thread() % each;
    part = warp_of_thread() / each;
    low = part * span;
    high = low + span;
    mine = warp * kChunk < cols;
    at_ = factor + f.chunk_offset(col / kChunk + (mine ? warp : 0), from) + lane_of_thread() * 2;
  }
  [[nodiscard]] __device__ int groups() const { return (panels + kPerGroup - 1) / kPerGroup; }
  /// Panel first + p into place p; nothing before the first and after the last.
  __device__ void load(int first, int p) {
#pragma unroll
    for (int h = 0; h < 2; ++h)
      l[p][h] = first >= 0 && first + p < panels
                    ? stream_pair(at_ + (static_cast<std::int64_t>(first) * 128 + p * 128 + h * 64))
                    : PairOf<T>{};
  }
  __device__ void load_all() {
#pragma unroll
    for (int p = 0; p < N; ++p) load((groups() - 1) * kPerGroup + high - N, p);
  }

 private:
  const T* at_;
};

/// v -= L(rows from `from` on, columns of the block)^T x. below: of these, loaded.
template <int N, class T, int R, bool K>
__device__ void subtract_below(const SolveState<T>& s, SolveBench<T, R, K>& b, BelowPanels<T, N>& below, int cols,
                               int from) {
  const Front& f = b.front;
  const int lane = lane_of_thread(), g = lane >> 2, t = lane & 3;
  constexpr int kPerGroup = kRowBlock / kPanel;
  if (below.panels == 0) return;
  T acc[4] = {};
  for (int k = below.groups() - 1; k >= 0; --k) {
    T* x = b.x + (k & 1) * kRowBlock;
    for (int y = threadIdx.x; y < kRowBlock; y += threads()) {
      const int r = from + k * kRowBlock + y, at = r < f.total_pad ? position_of_row(s, f, r) : -1;
      x[y] = at >= 0 ? await(s.solution + at, s.control, s.patience) : T(0);
    }
    __syncthreads();
    if (!below.mine) continue;
#pragma unroll 1
    for (int p0 = below.high - N; p0 >= below.low; p0 -= N) {
      const int next = p0 > below.low ? k * kPerGroup + p0 - N : (k - 1) * kPerGroup + below.high - N;
#pragma unroll
      for (int p = 0; p < N; ++p) {
        const T z = x[(p0 + p) * kPanel + g];
        acc[0] += below.l[p][0].x * z;
        acc[1] += below.l[p][0].y * z;
        acc[2] += below.l[p][1].x * z;
        acc[3] += below.l[p][1].y * z;
        below.load(next, p);
      }
    }
  }
  const T sum = sum_over_rows(acc);
  const int c = below.warp * kChunk + 4 * (g & 3) + t;
  const bool writes = below.mine && g < 4;
  if (below.parts == 1) {
    if (writes) b.v[c] -= sum;
    return;
  }
  __syncthreads();
  if (writes) b.x[below.part * cols + c] = sum;
  __syncthreads();
  for (int y = threadIdx.x; y < cols; y += threads()) {
    T total = b.x[y];
    for (int p = 1; p < below.parts; ++p) total += b.x[p * cols + y];
    b.v[y] -= total;
  }
}

/// Partial sums of columns [col, col_end) of a block times the values of its rows [row, row_end), each column from
/// where the inverse begins that it is a column of: part[h * (col_end - col) + ...] over half h of the panels.
/// value(r): of row r. A warp has a long and a short half at a time.
template <class T, class Value>
__device__ void multiply_columns(const BlockView<T>& a, int row, int row_end, int col, int col_end, T* part,
                                 Value&& value) {
  const int lane = lane_of_thread(), g = lane >> 2, t = lane & 3, units = 2 * (col_end - col) / kChunk;
#pragma unroll 1
  for (int unit = warp_of_thread(); unit < units; unit += warps()) {
    const int turn = unit / warps();
    const int mine = (turn & 1) == 0 ? unit : min((turn + 1) * warps(), units) - 1 - (unit - turn * warps());
    const int c = col + (mine >> 1) * kChunk, h = mine & 1, first = max(row, a.column_begin(c));
    const int panels = (row_end - first) / kPanel, half = (panels + 1) / 2;
    const T* from = a.panels(c / kChunk, first) + lane * 2;
    T acc[4] = {};
    for_each_unrolled<4>(h * half, h == 0 ? half : panels, [&](auto unroll, int p0) {
      constexpr int kUnroll = decltype(unroll)::value;
      PairOf<T> l[kUnroll][2];
#pragma unroll
      for (int p = 0; p < kUnroll; ++p)
#pragma unroll
        for (int k = 0; k < 2; ++k) l[p][k] = load_pair(from + (p0 + p) * 128 + k * 64);
#pragma unroll
      for (int p = 0; p < kUnroll; ++p) {
        const T z = value(first + kPanel * (p0 + p) + g);
        acc[0] += l[p][0].x * z;
        acc[1] += l[p][0].y * z;
        acc[2] += l[p][1].x * z;
        acc[3] += l[p][1].y * z;
      }
    });
    const T sum = sum_over_rows(acc);
    if (g < 4) part[h * (col_end - col) + (c - col) + 4 * (g & 3) + t] = sum;
  }
}

/// v = the forward solution of the block, times D^-1 for ldlt; zero in the padding, and where none has come up.
template <class T, int R, bool K>
__device__ void take_forward(const SolveState<T>& s, SolveBench<T, R, K>& b, int col, int cols, bool came) {
  const Front& f = b.front;
  for (int y = threadIdx.x; y < kRowBlock; y += threads()) {
    const bool real = came && y < cols && col + y < f.pivots;
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

/// One row block of pivots, as in a list of tasks. parity: of the barrier of what is kept; N: see BelowPanels.
template <int N, class T, int R, bool K>
__device__ void go_down(const SolveState<T>& s, SolveBench<T, R, K>& b, int block, unsigned& parity) {
  const Front& f = b.front;
  const int a = block < 0 ? -1 - block : block;
  const int col = f.block_begin(a), end = f.block_end(a), cols = end - col;
  const T* factor = s.base[f.region] + (s.down_second ? f.second : f.factor);
  keep_block(b, factor, col, end, end);
  BelowPanels<T, N> below(f, factor, col, cols, end);
  if (below.mine) below.load_all();
#pragma unroll 1
  for (int q = 0; q < cols / kChunk; ++q)  // what waits for the block above
    prefetch(factor + f.chunk_offset(col / kChunk + q, end), (min(end + kRowBlock, f.total_pad) - end) * kChunk);
  take_forward(s, b, col, cols, block >= 0);
  __syncthreads();
  subtract_below(s, b, below, cols, end);
  await_kept(b, parity);
  __syncthreads();
  with_block(b, factor, col, s.down_triangular, [&](const BlockView<T>& view) {
    for (int c0 = (cols - 1) / f.inverted * f.inverted; c0 >= 0; c0 -= f.inverted) {
      const int c1 = min(c0 + f.inverted, cols), size = c1 - c0;
      const bool more = c1 < cols;
      const T* left = b.x;                   // partial sums over the rows of the block after these columns
      T* own = b.x + (more ? 2 * size : 0);  // partial sums of the product with the inverse
      if (more) {
        multiply_columns(view, c1, cols, c0, c1, b.x, [&](int r) { return b.y[r]; });
        __syncthreads();
      }
      multiply_columns(view, c0, c1, c0, c1, own,
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
  });
}

}  // namespace

}  // namespace espalier::device::cuda

/// \file
/// Backward substitution for many right-hand sides: one row block of the pivots of a front.
#pragma once

#include "device/cuda/kernels/solve/solve_down.cuh"
#include "device/cuda/kernels/solve/solve_slabs.cuh"

namespace espalier::device::cuda {

namespace {

/// N panels of a chunk in registers, on their way to a product with L^T.
template <class T, int N>
struct Panels {
  T operand[N / 2][2][4] = {};  ///< two together; defined from the start: see for_each_unrolled()

  /// Those from `first` on; past `last` the last ones come again. load(pointer): an element.
  template <class Load>
  __device__ void fetch(const T* base, int first, int last, Load&& load) {
#pragma unroll
    for (int p = 0; p < N / 2; ++p)
      load_transposed(base + static_cast<std::int64_t>(min(first + 2 * p, last - 1)) * 128, operand[p], load);
  }
};

/// Sums of L^T x for the 16 columns of a chunk.
template <class T, int C>
struct ChunkSums {
  T of[2][4] = {};  ///< eight columns each

  /// x(row, slab, column of the slab): values at the panels, which begin at row `first`.
  template <int N, class X>
  __device__ void add(const Panels<T, N>& l, int first, X&& x) {
#pragma unroll
    for (int p = 0; p < N / 2; ++p) {
      T values[8];
      load_values<T, C>(values, [&](int r, int k, int c) { return x(first + p * kChunk + r, k, c); });
#pragma unroll
      for (int h = 0; h < 2; ++h) multiply_add(of[h], values, l.operand[p][h]);
    }
  }
  /// use(column of the chunk, right-hand side, sum)
  template <class Use>
  __device__ void finish(Use&& use) const {
#pragma unroll
    for (int h = 0; h < 2; ++h) for_each_sum<T, C>(of[h], [&](int i, int c, T sum) { use(8 * h + i, c, sum); });
  }
};

/// v -= L(rows from `from` on, columns of the block)^T x, from the last group of 128 rows up: what is known first comes
/// first. A warp has 16 columns, or, where there are too few, half or a quarter of every group's rows of them.
template <class T, int C, int R, int W>
__device__ void subtract_below(const SolveState<T>& s, SlabBench<T, C, R, W>& b, const T* factor, int col, int cols,
                               int from) {
  const Front& f = b.front;
  constexpr int kAtOnce = 4;  // panels in registers
  constexpr int kPerGroup = kRowBlock / kPanel;
  const int panels = (f.total_pad - from) / kPanel;
  if (panels == 0) return;
  const int parts = 4 * cols <= W / 32 * kChunk ? 4 : (2 * cols <= W / 32 * kChunk ? 2 : 1);
  const int each = W / 32 / parts, warp = warp_of_thread() % each, part = warp_of_thread() / each;
  const int span = kPerGroup / parts, low = part * span;
  const bool mine = warp * kChunk < cols;
  const T* base = factor + f.chunk_offset(col / kChunk + (mine ? warp : 0), from);
  ChunkSums<T, C> sums;
  Panels<T, kAtOnce> l;
  const auto load = [&](int p0) {
    if (mine && p0 >= 0) l.fetch(base, p0, panels - 1, [](const T* p) { return __ldcs(p); });
  };
  const int groups = (panels + kPerGroup - 1) / kPerGroup;
  GroupFetch<T, C, R, W> fetch;
  const auto locate = [&](int k) {
    fetch.locate([&](int y) {
      const int r = from + k * kRowBlock + y;
      return k >= 0 && r < f.total_pad ? position_of_row(s, f, r) : -1;
    });
  };
  load((groups - 1) * kPerGroup + low + span - kAtOnce);
  locate(groups - 1);
  fetch.ask(s, b, s.solution);
  locate(groups - 2);
  for (int k = groups - 1; k >= 0; --k) {
    T* x = b.x + (k & 1) * kRowBlock * C;
#pragma unroll 1
    for (int h = 1; h >= 0; --h) {
      fetch.take(s, b, s.solution, h, x);
      if (h == 0) {
        fetch.ask(s, b, s.solution);
        locate(k - 2);
      }
      __syncthreads();
      if (!mine) continue;
      const int bottom = max(low, h * kPerGroup / 2), top = min(low + span, (h + 1) * kPerGroup / 2);
#pragma unroll 1
      for (int p = top - kAtOnce; p >= bottom; p -= kAtOnce) {
        sums.add(l, p * kPanel, VectorView<T>{x, kRowBlock});
        load(p > low ? k * kPerGroup + p - kAtOnce : (k - 1) * kPerGroup + low + span - kAtOnce);
      }
    }
  }
  if (parts > 1) __syncthreads();
  sums.finish([&](int i, int c, T sum) {
    if (!mine) return;
    const int at = place(warp * kChunk + i, c, parts > 1 ? cols : R);
    if (parts > 1)
      b.x[part * cols * C + at] = sum;
    else
      b.v[at] -= sum;
  });
  if (parts == 1) return;
  __syncthreads();
  for (int y = threadIdx.x; y < cols * C; y += W) {
    const int at = place(y / C, y % C, cols);
    T sum = b.x[at];
    for (int p = 1; p < parts; ++p) sum += b.x[p * cols * C + at];
    b.v[place(y / C, y % C, R)] -= sum;
  }
}

/// Partial sums of columns [col, col_end) of a block times the values of its rows [row, row_end), each column from
/// where the inverse begins that it is a column of: part[h * size * C + ...], a vector of size = col_end - col rows,
/// over half h of the panels. x(row, slab, column of the slab).
template <class T, int C, class X>
__device__ void multiply_columns(const BlockView<T>& a, int row, int row_end, int col, int col_end, T* part, X&& x) {
  const int size = col_end - col, each = warps(), units = 2 * size / kChunk;
#pragma unroll 1
  for (int begin = 0, mine = warp_of_thread(); begin < units; begin += each, mine = each - 1 - mine) {
    const int unit = begin + mine;
    if (unit >= units) continue;
    const int c = col + (unit >> 1) * kChunk, h = unit & 1, first = max(row, a.column_begin(c));
    const int panels = (row_end - first) / kPanel, half = (panels / 2 + 1) / 2 * 2, end = h == 0 ? half : panels;
    const T* from = a.panels(c / kChunk, first);
    ChunkSums<T, C> sums;
    for_each_unrolled<2>(h * half / 2, end / 2, [&](auto unroll, int p) {
      Panels<T, 2 * decltype(unroll)::value> l;
      l.fetch(from, 2 * p, panels - 1, [](const T* at) { return *at; });
      sums.add(l, first + 2 * p * kPanel, x);
    });
    sums.finish([&](int i, int k, T sum) { part[h * size * C + place(c - col + i, k, size)] = sum; });
  }
}

/// v = the forward solution of the block, times D^-1 for ldlt; zero in the padding, and where none has come up.
template <class T, int C, int R, int W>
__device__ void take_forward(const SolveState<T>& s, SlabBench<T, C, R, W>& b, int col, int cols, bool came) {
  static_assert(R == kRowBlock);
  const Front& f = b.front;
  T* to = s.inverse_d != nullptr ? b.y : b.v;
  GroupFetch<T, C, R, W> fetch;
  fetch.locate([&](int r) { return came && r < cols && col + r < f.pivots ? f.position + col + r : -1; });
  fetch.ask(s, b, s.forward);
  fetch.take(s, b, s.forward, 0, to);
  fetch.take(s, b, s.forward, 1, to);
  if (s.inverse_d == nullptr) return;
  __syncthreads();
  for (int y = threadIdx.x; y < kRowBlock * C; y += W) {
    const int k = y / C, c = y % C, at = place(k, c, R), position = f.position + col + k;
    T v = T(0);
    if (k < cols && col + k < f.pivots) {
      v = s.inverse_d[position] * b.y[at];
      const T e = s.inverse_e[position];
      if (e != T(0)) v += e * b.y[at + kSlab];
      const T before = col + k > 0 ? s.inverse_e[position - 1] : T(0);
      if (before != T(0) && k > 0) v += before * b.y[at - kSlab];
    }
    b.v[at] = v;
  }
}

/// One row block of pivots, as in a list of tasks.
template <class T, int C, int R, int W>
__device__ void go_down(const SolveState<T>& s, SlabBench<T, C, R, W>& b, int block) {
  const Front& f = b.front;
  const int a = block < 0 ? -1 - block : block;
  const int col = f.block_begin(a), end = f.block_end(a), cols = end - col;
  const T* factor = s.base[f.region] + (s.down_second ? f.second : f.factor);
  prefetch_block(f, factor, col, end, end);
  describe_chunks(f.total_pad - col, f.width_log2, b.chunk_at);
#pragma unroll 1
  for (int q = 0; q < cols / kChunk; ++q)  // what waits for the block above
    prefetch(factor + f.chunk_offset(col / kChunk + q, end), (min(end + kRowBlock, f.total_pad) - end) * kChunk);
  take_forward(s, b, col, cols, block >= 0);
  __syncthreads();
  subtract_below(s, b, factor, col, cols, end);
  __syncthreads();
  const int first_column = s.first_column + b.first;
  const BlockView<T> view{factor + f.chunk_offset(col / kChunk, col), b.chunk_at, f.width_log2, s.down_triangular};
  const VectorView<T> v{b.v, R}, finished{b.y, kRowBlock};
  for (int c0 = (cols - 1) / f.inverted * f.inverted; c0 >= 0; c0 -= f.inverted) {
    const int c1 = min(c0 + f.inverted, cols), size = c1 - c0;
    const bool more = c1 < cols;
    T* own = b.x + (more ? 2 * size * C : 0);  // partial sums of the product with the inverse
    if (more) {                                // and those over the rows of the block after these columns
      multiply_columns<T, C>(view, c1, cols, c0, c1, b.x, finished);
      __syncthreads();
    }
    const VectorView<T> left{b.x, size}, right{b.x + size * C, size};
    multiply_columns<T, C>(view, c0, c1, c0, c1, own, [&](int r, int k, int c) {
      return more ? v(r, k, c) - (left(r - c0, k, c) + right(r - c0, k, c)) : v(r, k, c);
    });
    __syncthreads();
    for (int y = threadIdx.x; y < size * C; y += W) {
      const int r = col + c0 + y / C, c = y % C, k = place(y / C, c, size);
      const T value = own[k] + own[size * C + k];
      b.y[place(c0 + y / C, c, kRowBlock)] = value;
      if (r >= f.pivots) continue;
      publish(s.solution + element(s, b, f.position + r, c), value);
      if (first_column + c < s.columns && s.speaks_for(f))
        s.result[static_cast<std::int64_t>(f.position + r) * s.columns + first_column + c] = value;
    }
    if (c0 > 0) __syncthreads();
  }
}

}  // namespace

}  // namespace espalier::device::cuda

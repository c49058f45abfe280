/// \file
/// Forward substitution for many right-hand sides: one row block of a front.
#pragma once

#include "device/cuda/kernels/solve/solve_slabs.cuh"

namespace espalier::device::cuda {

namespace {

/// Updates of one child on their way to a block: a thread has N words of two neighbouring columns.
template <class T, int N>
struct ChildUpdates {
  int at[N];  ///< place of the row in the parent; -1: none
  PairOf<T> value[N];

  __device__ bool missing(int j) const { return at[j] >= 0 && (is_missing(value[j].x) || is_missing(value[j].y)); }
  __device__ bool any_missing() const {
    bool any = false;
#pragma unroll
    for (int j = 0; j < N; ++j) any = any || missing(j);
    return any;
  }
};

/// v += the children's updates that fall into tile rows [tile, tile_end); row0: padded row of v[0]. The values of the
/// next child are fetched while those of one are added.
template <class T, int C, int R, int W>
__device__ void gather_updates(const SolveState<T>& s, SlabBench<T, C, R, W>& b, int tile, int tile_end, int row0) {
  constexpr int kEach = R > kRowBlock ? 2 : 1;
  using Updates = ChildUpdates<T, kEach>;
  constexpr int kWords = C / 2;  // of a row
  const Front& f = b.front;
  const ChildList& list = b.children;
  const int gap = f.pivot_pad - f.pivots;
  for (int base = f.link_begin; base < f.link_end; base += 32) {
    if (threadIdx.x < 32) find_children(s, f, b.children, base, tile, tile_end);
    __syncthreads();
    const int count = list.count;
    const auto first = [&](int k) { return k < count ? list.begin[k] * kWords + static_cast<int>(threadIdx.x) : 0; };
    const auto from = [&](int k, int z) {
      return s.updates + element(s, b, list.rows[k] + z / kWords, z % kWords * 2);
    };
    const auto ask = [&](int k, int y, Updates& u) {
#pragma unroll
      for (int j = 0; j < kEach; ++j) {
        const int z = y + j * W;
        u.at[j] = -1;
        if (k >= count || z >= list.end[k] * kWords) continue;
        u.at[j] = s.relative[list.rows[k] + z / kWords];
        u.value[j] = load_shared_pair(from(k, z));
      }
    };
    const auto add = [&](int k, int y, Updates& u) {
      Wait wait;
      while (u.any_missing() && wait.goes_on(s.control, s.patience))
#pragma unroll
        for (int j = 0; j < kEach; ++j)
          if (u.missing(j)) u.value[j] = load_shared_pair(from(k, y + j * W));
#pragma unroll
      for (int j = 0; j < kEach; ++j) {
        if (u.at[j] < 0) continue;
        const int row = u.at[j] + (u.at[j] >= f.pivots ? gap : 0) - row0;
        T* const to = b.v + place(row, (y + j * W) % kWords * 2, R);
        to[0] += u.value[j].x;
        to[1] += u.value[j].y;
      }
    };
    Updates now, next;
    int y = first(0);
    ask(0, y, now);
    for (int k = 0; k < count; ++k) {
      ask(k + 1, first(k + 1), next);
      for (;;) {
        add(k, y, now);
        y += kEach * W;
        if (y >= list.end[k] * kWords) break;
        ask(k, y, now);
      }
      y = first(k + 1);
      now = next;
      __syncthreads();
    }
    if (count == 0) __syncthreads();
  }
}

/// v -= L(rows of the block, columns before it) times the finished part of the forward solution. A warp has 16 rows;
/// columns go by in groups of 128.
template <class T, int C, int R, int W>
__device__ void subtract_left(const SolveState<T>& s, SlabBench<T, C, R, W>& b, const T* factor, int row, int rows,
                              int chunks) {
  const Front& f = b.front;
  const int top = warp_of_thread() * 16;
  constexpr int kAtOnce = 2;  // chunks that a warp has on their way
  constexpr int kPerGroup = kRowBlock / kChunk;
  if (chunks == 0) return;
  const bool mine = top < rows;
  T sums[2][4] = {};
  FactorPanels<T, kAtOnce> panels(f, factor, row, top, chunks);
  const auto load = [&](int q0) {
    if (mine && q0 < chunks) panels.load_all();
  };
  const auto multiply = [&](const VectorView<T>& x) {  // x: values at the first of the chunks in registers
#pragma unroll
    for (int q = 0; q < kAtOnce; ++q) {
      T values[8], panel[4];
      load_values<T, C>(values, x.from(q * kChunk));
#pragma unroll
      for (int p = 0; p < 2; ++p) {
        order_panel<T>(panels.l[q][p], panel);
        multiply_add(sums[p], values, panel);
      }
    }
  };
  GroupFetch<T, C, R, W> fetch;
  const int real = min(chunks * kChunk, f.pivots), groups = (chunks + kPerGroup - 1) / kPerGroup;
  const auto locate = [&](int k) {
    fetch.locate([&](int r) { return k * kRowBlock + r < real ? f.position + k * kRowBlock + r : -1; });
  };
  load(0);
  locate(0);
  fetch.ask(s, b, s.forward);
  locate(1);
  for (int k = 0; k < groups; ++k) {
    T* x = b.x + (k & 1) * kRowBlock * C;
#pragma unroll 1
    for (int h = 0; h < 2; ++h) {
      fetch.take(s, b, s.forward, h, x);
      if (h == 1) {
        fetch.ask(s, b, s.forward);
        locate(k + 2);
      }
      __syncthreads();
      if (!mine) continue;
#pragma unroll 1
      for (int q = h * kPerGroup / 2; q < (h + 1) * kPerGroup / 2; q += kAtOnce) {
        multiply(VectorView<T>{x, kRowBlock}.from(q * kChunk));
        load(k * kPerGroup + q + kAtOnce);
      }
    }
  }
  if (!mine) return;
#pragma unroll
  for (int p = 0; p < 2; ++p)
    for_each_sum<T, C>(sums[p], [&](int r, int c, T sum) { b.v[place(top + 8 * p + r, c, R)] -= sum; });
}

/// Calls use(row, right-hand side, sum) with the products of rows [row, row_end) of a block with columns
/// [col, col_end), each as far as the inverse goes that it is a row of; in: values by column. A warp takes panels forth
/// and back, so that long and short ones go together.
template <class T, int C, class Use>
__device__ void multiply_rows(const BlockView<T>& a, int row, int row_end, int col, int col_end,
                              const VectorView<T>& in, Use&& use) {
  const int lane = lane_of_thread(), each = warps(), panels = (row_end - row) / kPanel;
#pragma unroll 1
  for (int first = 0, mine = warp_of_thread(); first < panels; first += each, mine = each - 1 - mine) {
    if (first + mine >= panels) continue;
    const int r = row + (first + mine) * kPanel, end = min(col_end, a.row_end(r));
    T sum[4] = {};
    for_each_unrolled<4>(col / kChunk, end / kChunk, [&](auto unroll, int q) {
      constexpr int kUnroll = decltype(unroll)::value;
      PairOf<T> l[kUnroll][2];
#pragma unroll
      for (int k = 0; k < kUnroll; ++k)
#pragma unroll
        for (int h = 0; h < 2; ++h) l[k][h] = load_pair(a.panels(q + k, r) + lane * 2 + 64 * h);
#pragma unroll
      for (int k = 0; k < kUnroll; ++k) {
        T values[8], panel[4];
        load_values<T, C>(values, in.from((q + k) * kChunk));
        order_panel<T>(l[k], panel);
        multiply_add(sum, values, panel);
      }
    });
    for_each_sum<T, C>(sum, [&](int i, int c, T x) { use(r + i, c, x); });
  }
}

/// Rows [first, first + count) of a vector of the pass = rows of `from`, a vector of `rows` rows in shared memory.
template <class T, int C, int R, int W>
__device__ void publish_rows(const SolveState<T>& s, const SlabBench<T, C, R, W>& b, const T* from, int rows, T* to,
                             std::int64_t first, int count) {
  for (int y = threadIdx.x; y < count * C; y += W)
    publish(to + element(s, b, first + y / C, y % C), from[place(y / C, y % C, rows)]);
}

/// Hands the updates of `count` rows below, from row `first` of the front's list on, to the parents' devices.
template <class T, int C, int R, int W>
__device__ void publish_updates(const SolveState<T>& s, const SlabBench<T, C, R, W>& b, const T* from, int first,
                                int count) {
  const std::int64_t at = b.front.rows + first;
  publish_rows(s, b, from, R, s.updates, at, count);
  for (unsigned set = s.listeners(b.front); set != 0; set &= set - 1)
    publish_rows(s, b, from, R, s.peer_updates[__ffs(static_cast<int>(set)) - 1], at, count);
}

/// One row block of a front; block < 0: a front of one block in all.
template <class T, int C, int R, int W>
__device__ void go_up(const SolveState<T>& s, SlabBench<T, C, R, W>& b, int block) {
  const Front& f = b.front;
  const bool all = block < 0;
  const int a = all ? 0 : block;
  const bool pivot = a < f.pivot_blocks;
  const int row = f.block_begin(a), end = all ? f.total_pad : f.block_end(a), rows = end - row;
  const int per_block = kRowBlock / f.width;
  const int tile = pivot ? a * per_block : f.pivot_tiles + (a - f.pivot_blocks) * per_block;
  const int tile_end = all ? f.tiles : min(tile + per_block, pivot ? f.pivot_tiles : f.tiles);
  const T* factor = s.base[f.region] + (s.up_second ? f.second : f.factor);
  const int tiles_here = pivot ? (all ? f.pivot_tiles : tile_end) : tile;
  if (tile < tiles_here) prefetch_block(f, factor, row, f.column_end(tiles_here - 1), end);
  describe_chunks(f.total_pad - row, f.width_log2, b.chunk_at);
  const int first_column = s.first_column + b.first;
  for (int y = threadIdx.x; y < rows * C; y += W) {
    const int r = row + y / C, c = first_column + y % C;
    b.v[place(y / C, y % C, R)] = pivot && r < f.pivots && c < s.columns
                                      ? s.rhs[static_cast<std::int64_t>(f.position + r) * s.columns + c]
                                      : T(0);
  }
  __syncthreads();
  gather_updates(s, b, tile, tile_end, row);
  if constexpr (R == kRowBlock) subtract_left(s, b, factor, row, rows, (pivot ? row : f.pivot_pad) / kChunk);
  __syncthreads();
  const BlockView<T> view{factor + (tile < tiles_here ? f.chunk_offset(row / kChunk, row) : 0), b.chunk_at,
                          f.width_log2, s.up_triangular};
  const VectorView<T> v{b.v, R}, finished{b.y, kRowBlock};
  const int pivots_end = tile < tiles_here ? f.column_end(tiles_here - 1) - row : 0;
  for (int col = 0; col < pivots_end; col += f.inverted) {
    const int last = min(col + f.inverted, pivots_end);
    multiply_rows<T, C>(view, col, last, col, last, v, [&](int r, int c, T y) { b.y[place(r, c, kRowBlock)] = y; });
    __syncthreads();
    publish_rows(s, b, b.y + col * kSlab, kRowBlock, s.forward, f.position + row + col,
                 min(last, f.pivots - row) - col);
    if (last == rows) break;
    multiply_rows<T, C>(view, last, rows, col, last, finished,
                        [&](int r, int c, T sum) { b.v[place(r, c, R)] -= sum; });
    __syncthreads();
  }
  if (all)
    publish_updates(s, b, b.v + f.pivot_pad * kSlab, 0, f.below);
  else if (!pivot)
    publish_updates(s, b, b.v, row - f.pivot_pad, min(rows, f.below - (row - f.pivot_pad)));
}

}  // namespace

}  // namespace espalier::device::cuda

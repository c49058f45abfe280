/// \file
/// Forward substitution for one right-hand side: one row block of a front.
#pragma once

#include "device/cuda/kernels/solve/solve_bench.cuh"

namespace espalier::device::cuda {

namespace {

/// v += the children's updates that fall into tile rows [tile, tile_end); row0: padded row of v[0]. The values of the
/// next child are fetched while those of one are added.
template <class T, int R, bool K>
__device__ void gather_updates(const SolveState<T>& s, SolveBench<T, R, K>& b, int tile, int tile_end, int row0) {
  const Front& f = b.front;
  const ChildList& list = b.children;
  const int gap = f.pivot_pad - f.pivots;
  for (int base = f.link_begin; base < f.link_end; base += 32) {
    if (threadIdx.x < 32) find_children(s, f, b.children, base, tile, tile_end);
    __syncthreads();
    const int count = list.count;
    const auto fetch = [&](int k, int y, T& value) {
      if (k >= count || y >= list.end[k]) return -1;
      const std::int64_t row = list.rows[k] + y;
      const int to = s.relative[row];
      value = await(s.updates + row, s.control, s.patience);
      return to + (to >= f.pivots ? gap : 0) - row0;
    };
    T value{};
    int y = count > 0 ? list.begin[0] + static_cast<int>(threadIdx.x) : 0;
    int to = fetch(0, y, value);
    for (int k = 0; k < count; ++k) {
      T next{};
      const int z = k + 1 < count ? list.begin[k + 1] + static_cast<int>(threadIdx.x) : 0;
      const int next_to = fetch(k + 1, z, next);
      while (to >= 0) {
        b.v[to] += value;
        y += threads();
        to = fetch(k, y, value);
      }
      y = z;
      to = next_to;
      value = next;
      __syncthreads();
    }
    if (count == 0) __syncthreads();
  }
}

/// Brings the finished values at rows [first, first + 128) of `from`, as far as they are below `end`, to shared memory.
template <class T>
__device__ inline void stage_values(const SolveState<T>& s, const T* from, int first, int end, T* to) {
  for (int k = threadIdx.x; k < kRowBlock; k += threads())
    to[k] = first + k < end ? await(from + first + k, s.control, s.patience) : T(0);
}

/// Chunks of the factor that a warp has on their way: of the group of 128 columns that came last, half is here already
/// and half in the L2 cache when its values arrive. (2 of them and no cache: 3 microseconds from those values to the
/// sums, three trips to memory.)
constexpr int kChunksAtOnce = 4;

template <class T>
using LeftPanels = FactorPanels<T, kChunksAtOnce>;

/// v -= L(rows of the block, columns before it) times the finished part of the forward solution. A warp has 16 rows;
/// columns go by in groups of 128. panels: of this warp's rows, loaded.
template <class T, int R, bool K>
__device__ void subtract_left(const SolveState<T>& s, SolveBench<T, R, K>& b, LeftPanels<T>& panels, int rows,
                              int chunks) {
  const Front& f = b.front;
  const int lane = lane_of_thread(), g = lane >> 2, t = lane & 3, top = warp_of_thread() * 16;
  constexpr int kPerGroup = kRowBlock / kChunk;
  const bool mine = top < rows;
  T acc[2][2] = {};
  for (int first = 0; first < chunks; first += kPerGroup) {
    T* x = b.x + (first / kPerGroup & 1) * kRowBlock;
    stage_values(s, s.forward + f.position, first * kChunk, min(chunks * kChunk, f.pivots), x);
    __syncthreads();
    if (!mine) continue;
#pragma unroll 1
    for (int q0 = 0; q0 < kPerGroup; q0 += kChunksAtOnce) {
#pragma unroll
      for (int q = 0; q < kChunksAtOnce; ++q) {
#pragma unroll
        for (int u = 0; u < 4; ++u) {
          const T y = x[(q0 + q) * kChunk + 4 * u + t];
#pragma unroll
          for (int p = 0; p < 2; ++p)
            acc[p][u >> 1] += ((u & 1) != 0 ? panels.l[q][p][u >> 1].y : panels.l[q][p][u >> 1].x) * y;
        }
        if (first + q0 + kChunksAtOnce < chunks) panels.load(q);
      }
    }
  }
  const T total = sum_over_columns(acc[0][0] + acc[0][1], acc[1][0] + acc[1][1]);
  if (t < 2 && mine) b.v[top + 8 * t + g] -= total;
}

/// Calls use(row, sum) with the products of rows [row, row_end) of a block with columns [col, col_end), each as far as
/// the inverse goes that it is a row of; in: values by column, in shared memory. A warp has two panels at a time, from
/// both ends, so that long and short ones go together.
template <class T, class Use>
__device__ void multiply_rows(const BlockView<T>& a, int row, int row_end, int col, int col_end, const T* in,
                              Use&& use) {
  const int lane = lane_of_thread(), g = lane >> 2, t = lane & 3, panels = (row_end - row) / kPanel;
#pragma unroll 1
  for (int p = warp_of_thread(); p < panels / 2; p += warps()) {
    const int r0 = row + p * kPanel, r1 = row + (panels - 1 - p) * kPanel;
    const int end0 = min(col_end, a.row_end(r0)) / kChunk, end1 = min(col_end, a.row_end(r1)) / kChunk;
    T acc[2][2] = {};
    const auto add = [&](auto unroll, int q, auto one) {  // chunks from q on; one: of the second panel alone
      constexpr int kUnroll = decltype(unroll)::value, kFirst = decltype(one)::value ? 1 : 0;
      PairOf<T> l[kUnroll][2][2];
#pragma unroll
      for (int k = 0; k < kUnroll; ++k)
#pragma unroll
        for (int i = kFirst; i < 2; ++i)
#pragma unroll
          for (int h = 0; h < 2; ++h) l[k][i][h] = load_pair(a.panels(q + k, i == 0 ? r0 : r1) + lane * 2 + h * 64);
#pragma unroll
      for (int k = 0; k < kUnroll; ++k) {
        const T* y = in + (q + k) * kChunk + t;
#pragma unroll
        for (int i = kFirst; i < 2; ++i) {
          acc[i][0] += l[k][i][0].x * y[0];
          acc[i][1] += l[k][i][0].y * y[4];
          acc[i][0] += l[k][i][1].x * y[8];
          acc[i][1] += l[k][i][1].y * y[12];
        }
      }
    };
    for_each_unrolled<2>(col / kChunk, end0, [&](auto unroll, int q) { add(unroll, q, std::false_type{}); });
    for_each_unrolled<4>(end0, end1, [&](auto unroll, int q) { add(unroll, q, std::true_type{}); });
    const T sum = sum_over_columns(acc[0][0] + acc[0][1], acc[1][0] + acc[1][1]);
    if (t < 2) use((t == 0 ? r0 : r1) + g, sum);
  }
}

template <class T>
__device__ void publish_rows(const T* from, T* to, int count) {
  for (int y = threadIdx.x; y < count; y += threads()) publish(to + y, from[y]);
}

/// Hands the updates of `count` rows below, from row `first` of the front's list on, to the parents' devices.
template <class T>
__device__ void publish_updates(const SolveState<T>& s, const Front& f, const T* from, int first, int count) {
  const std::int64_t at = f.rows + first;
  publish_rows(from, s.updates + at, count);
  for (unsigned set = s.listeners(f); set != 0; set &= set - 1)
    publish_rows(from, s.peer_updates[__ffs(static_cast<int>(set)) - 1] + at, count);
}

/// One row block of a front; block < 0: a front of one block in all. parity: of the barrier of what is kept.
template <class T, int R, bool K>
__device__ void go_up(const SolveState<T>& s, SolveBench<T, R, K>& b, int block, unsigned& parity) {
  const Front& f = b.front;
  const bool all = block < 0;
  const int a = all ? 0 : block;
  const bool pivot = a < f.pivot_blocks;
  const int row = f.block_begin(a), end = all ? f.total_pad : f.block_end(a), rows = end - row;
  const int per_block = kRowBlock / f.width;
  const int tile = pivot ? a * per_block : f.pivot_tiles + (a - f.pivot_blocks) * per_block;
  const int tile_end = all ? f.tiles : min(tile + per_block, pivot ? f.pivot_tiles : f.tiles);
  const T* factor = s.base[f.region] + (s.up_second ? f.second : f.factor);
  for (int y = threadIdx.x; y < rows; y += threads()) {
    const int r = row + y;
    b.v[y] =
        pivot && r < f.pivots ? s.rhs[static_cast<std::int64_t>(f.position + r) * s.columns + s.first_column] : T(0);
  }
  const int tiles_here = pivot ? (all ? f.pivot_tiles : tile_end) : tile;
  const bool diagonal = tile < tiles_here;
  if (diagonal) keep_block(b, factor, row, f.column_end(tiles_here - 1), end);
  const int before = (pivot ? row : f.pivot_pad) / kChunk;  // chunks
  LeftPanels<T> left(f, factor, row, warp_of_thread() * 16, before);
  if constexpr (R == kRowBlock) {
    if (before > 0 && warp_of_thread() * 16 < rows) left.load_all();
#pragma unroll 1
    for (int q = max(0, before - kChunksAtOnce); q < before; ++q)  // what waits for the block before
      prefetch(factor + f.chunk_offset(q, row), rows * kChunk);
  }
  __syncthreads();
  gather_updates(s, b, tile, tile_end, row);
  if constexpr (R == kRowBlock)
    if (before > 0) subtract_left(s, b, left, rows, before);
  if (diagonal) await_kept(b, parity);
  __syncthreads();
  const int pivots_end = diagonal ? f.column_end(tiles_here - 1) - row : 0;
  const auto finish = [&](const BlockView<T>& view) {
    for (int col = 0; col < pivots_end; col += f.inverted) {
      const int last = min(col + f.inverted, pivots_end);
      multiply_rows(view, col, last, col, last, b.v, [&](int r, T y) {
        b.y[r] = y;
        if (row + r < f.pivots) publish(s.forward + f.position + row + r, y);
      });
      if (last == rows) break;
      __syncthreads();
      multiply_rows(view, last, rows, col, last, b.y, [&](int r, T sum) { b.v[r] -= sum; });
      __syncthreads();
    }
  };
  if (diagonal) with_block(b, factor, row, s.up_triangular, finish);
  if (all)
    publish_updates(s, f, b.v + f.pivot_pad, 0, f.below);
  else if (!pivot)
    publish_updates(s, f, b.v, row - f.pivot_pad, min(rows, f.below - (row - f.pivot_pad)));
}

}  // namespace

}  // namespace espalier::device::cuda

/// \file
/// Forward substitution: one row block of a front.
#pragma once

#include "device/cuda/solve_bench.cuh"

namespace espalier::device::cuda {

namespace {

/// v += the children's updates that fall into tile rows [tile, tile_end); row0: padded row of v[0]. The values of the
/// next child are fetched while those of one are added.
template <class T, int C, int R>
__device__ void gather_updates(const SolveState<T>& s, SolveBench<T, C, R>& b, int tile, int tile_end, int row0) {
  const Front& f = b.front;
  const int gap = f.pivot_pad - f.pivots, lane = lane_of_thread();
  for (int base = f.link_begin; base < f.link_end; base += 32) {
    if (threadIdx.x < 32) {
      int r0 = 0, r1 = 0;
      std::int64_t rows = 0;
      if (base + lane < f.link_end) {
        const Link link = s.links[base + lane];
        r0 = s.bounds[link.bound + tile];
        r1 = s.bounds[link.bound + tile_end];
        rows = s.fronts[link.child].rows;
      }
      const unsigned mask = __ballot_sync(0xffffffffu, r0 < r1);
      const int at = __popc(mask & ((1u << lane) - 1));
      if (r0 < r1) {
        b.child_begin[at] = r0;
        b.child_end[at] = r1;
        b.child_rows[at] = rows;
      }
      if (lane == 0) b.children = __popc(mask);
    }
    __syncthreads();
    const int count = b.children;
    const auto fetch = [&](int k, int y, T& value) {
      if (k >= count || y >= b.child_end[k] * C) return -1;
      const std::int64_t first = b.child_rows[k];
      const int to = s.relative[first + y / C];
      value = await(s.updates + first * C + y, s.control, s.patience);
      return (to + (to >= f.pivots ? gap : 0) - row0) * C + y % C;
    };
    T value{};
    int y = count > 0 ? b.child_begin[0] * C + static_cast<int>(threadIdx.x) : 0;
    int to = fetch(0, y, value);
    for (int k = 0; k < count; ++k) {
      T next{};
      const int z = k + 1 < count ? b.child_begin[k + 1] * C + static_cast<int>(threadIdx.x) : 0;
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
template <class T, int C>
__device__ inline void stage_values(const SolveState<T>& s, const T* from, int first, int end, T* to) {
  for (int k = threadIdx.x; k < kRowBlock * C; k += threads())
    to[k] = first + k / C < end ? await(from + static_cast<std::int64_t>(first) * C + k, s.control, s.patience) : T(0);
}

/// v -= L(rows of the block, columns before it) times the finished part of the forward solution. A warp has 16 rows;
/// columns go by in groups of 128.
template <class T, int C, int R>
__device__ void subtract_left(const SolveState<T>& s, SolveBench<T, C, R>& b, const T* factor, int row, int rows,
                              int chunks) {
  const Front& f = b.front;
  const int lane = lane_of_thread(), g = lane >> 2, t = lane & 3, top = warp_of_thread() * 16;
  constexpr int kAtOnce = C == 1 || kTensors<T, C> ? 2 : 1;  // chunks in registers
  constexpr int kPerGroup = kRowBlock / kChunk;
  if (chunks == 0) return;
  const bool mine = top < rows;
  T acc[2][C] = {}, sum[4] = {};
  PairOf<T> l[kAtOnce][2][2];
  const auto load = [&](int q0) {
    if (!mine || q0 >= chunks) return;
#pragma unroll
    for (int q = 0; q < kAtOnce; ++q) {
      // Past the end the last chunk comes again; the values that it meets are zero.
      const T* from = factor + f.chunk_offset(min(q0 + q, chunks - 1), row) + top * kChunk + lane * 2;
#pragma unroll
      for (int p = 0; p < 2; ++p)
#pragma unroll
        for (int h = 0; h < 2; ++h) l[q][p][h] = stream_pair(from + p * 128 + h * 64);
    }
  };
  load(0);
  for (int first = 0; first < chunks; first += kPerGroup) {
    T* x = b.x + (first / kPerGroup & 1) * kRowBlock * C;
    stage_values<T, C>(s, s.forward + static_cast<std::int64_t>(f.position) * C, first * kChunk,
                       min(chunks * kChunk, f.pivots), x);
    __syncthreads();
    if (!mine) continue;
#pragma unroll 1
    for (int q0 = 0; q0 < kPerGroup; q0 += kAtOnce) {
#pragma unroll
      for (int q = 0; q < kAtOnce; ++q) {
        if constexpr (kTensors<T, C>) {
          multiply_eight(sum, l[q], x + (q0 + q) * kChunk * C);
          continue;
        }
#pragma unroll
        for (int u = 0; u < 4; ++u)
#pragma unroll
          for (int c = 0; c < C; ++c) {
            const T y = x[((q0 + q) * kChunk + 4 * u + t) * C + c];
#pragma unroll
            for (int p = 0; p < 2; ++p) acc[p][c] += ((u & 1) != 0 ? l[q][p][u >> 1].y : l[q][p][u >> 1].x) * y;
          }
      }
      load(first + q0 + kAtOnce);
    }
  }
  if constexpr (kTensors<T, C>) {
#pragma unroll
    for (int e = 0; e < 4; ++e)
      if (mine) b.v[(top + g + 8 * (e >> 1)) * C + 2 * t + (e & 1)] -= sum[e];
    return;
  }
#pragma unroll
  for (int p = 0; p < 2; ++p)
#pragma unroll
    for (int c = 0; c < C; ++c) {
      const T total = sum_over_columns(acc[p][c]);
      if (t == 0 && mine) b.v[(top + 8 * p + g) * C + c] -= total;
    }
}

/// out(rows) = beta out + alpha A in for `rows` x `cols` panels at `a` (chunks `stride` apart); in, out in shared
/// memory.
template <class T, int C>
__device__ void multiply_panels(const T* a, std::int64_t stride, int rows, int cols, const T* in, T* out,
                                bool subtract) {
  const int lane = lane_of_thread(), g = lane >> 2, t = lane & 3;
  if constexpr (kTensors<T, C>) {
    for (int p = warp_of_thread(); p < rows / 16; p += warps()) {
      T sum[4] = {};
      PairOf<T> l[4][2][2];
#pragma unroll
      for (int q = 0; q < 4; ++q)
        if (q < cols / kChunk)
#pragma unroll
          for (int h = 0; h < 4; ++h)
            l[q][h >> 1][h & 1] = load_pair(a + q * stride + (2 * p + (h >> 1)) * 128 + lane * 2 + 64 * (h & 1));
#pragma unroll
      for (int q = 0; q < 4; ++q)
        if (q < cols / kChunk) multiply_eight(sum, l[q], in + q * kChunk * C);
#pragma unroll
      for (int e = 0; e < 4; ++e) {
        T* to = out + (16 * p + g + 8 * (e >> 1)) * C + 2 * t + (e & 1);
        *to = subtract ? *to - sum[e] : sum[e];
      }
    }
    return;
  }
  for (int p = warp_of_thread(); p < rows / 8; p += warps()) {
    T acc[C] = {};
    PairOf<T> l[4][2];
#pragma unroll
    for (int q = 0; q < 4; ++q)
      if (q < cols / kChunk) {
        l[q][0] = load_pair(a + q * stride + p * 128 + lane * 2);
        l[q][1] = load_pair(a + q * stride + p * 128 + lane * 2 + 64);
      }
#pragma unroll
    for (int q = 0; q < 4; ++q)
      if (q < cols / kChunk) {
        const T* y = in + (q * kChunk + t) * C;
#pragma unroll
        for (int c = 0; c < C; ++c)
          acc[c] += l[q][0].x * y[c] + l[q][0].y * y[4 * C + c] + l[q][1].x * y[8 * C + c] + l[q][1].y * y[12 * C + c];
      }
#pragma unroll
    for (int c = 0; c < C; ++c) {
      const T sum = sum_over_columns(acc[c]);
      T* to = out + (8 * p + g) * C + c;
      if (t == 0) *to = subtract ? *to - sum : sum;
    }
  }
}

template <class T, int C>
__device__ void publish_rows(const T* from, T* to, int count) {
  for (int y = threadIdx.x; y < count * C; y += threads()) publish(to + y, from[y]);
}

/// Hands the updates of `count` rows below, from row `first` of the front's list on, to the parents' devices.
template <class T, int C>
__device__ void publish_updates(const SolveState<T>& s, const Front& f, const T* from, int first, int count) {
  const std::int64_t at = (f.rows + first) * C;
  publish_rows<T, C>(from, s.updates + at, count);
  for (unsigned set = s.listeners(f); set != 0; set &= set - 1)
    publish_rows<T, C>(from, s.peer_updates[__ffs(static_cast<int>(set)) - 1] + at, count);
}

/// One row block of a front; block < 0: a front of one block in all.
template <class T, int C, int R>
__device__ void go_up(const SolveState<T>& s, SolveBench<T, C, R>& b, int block, int first_column) {
  const Front& f = b.front;
  const bool all = block < 0;
  const int a = all ? 0 : block;
  const bool pivot = a < f.pivot_blocks;
  const int row = f.block_begin(a), end = all ? f.total_pad : f.block_end(a), rows = end - row;
  const int per_block = kRowBlock / f.width;
  const int tile = pivot ? a * per_block : f.pivot_tiles + (a - f.pivot_blocks) * per_block;
  const int tile_end = all ? f.tiles : min(tile + per_block, pivot ? f.pivot_tiles : f.tiles);
  const T* factor = s.base[f.region] + (s.up_second ? f.second : f.factor);
  for (int y = threadIdx.x; y < rows * C; y += threads()) {
    const int r = row + y / C, c = first_column + y % C;
    b.v[y] = pivot && r < f.pivots && c < s.columns ? s.rhs[static_cast<std::int64_t>(f.position + r) * s.columns + c]
                                                    : T(0);
  }
  const int tiles_here = pivot ? (all ? f.pivot_tiles : tile_end) : tile;
  for (int j = tile; j < tiles_here; ++j)  // what comes last, and is waited for by others
    for (int q = f.column_begin(j) / kChunk; q < f.column_end(j) / kChunk; ++q)
      prefetch(factor + f.chunk_offset(q, f.column_begin(j)), (end - f.column_begin(j)) * kChunk);
  __syncthreads();
  gather_updates(s, b, tile, tile_end, row);
  if constexpr (R == kRowBlock) subtract_left(s, b, factor, row, rows, (pivot ? row : f.pivot_pad) / kChunk);
  __syncthreads();
  for (int j = tile; j < tiles_here; ++j) {
    const int col = f.column_begin(j), last = f.column_end(j), size = last - col, q = col / kChunk;
    const std::int64_t stride = static_cast<std::int64_t>(f.total_pad - j * f.width) * kChunk;
    multiply_panels<T, C>(factor + f.chunk_offset(q, col), stride, size, size, b.v + (col - row) * C, b.y, false);
    __syncthreads();
    publish_rows<T, C>(b.y, s.forward + static_cast<std::int64_t>(f.position + col) * C, min(size, f.pivots - col));
    if (last < end)
      multiply_panels<T, C>(factor + f.chunk_offset(q, last), stride, end - last, size, b.y, b.v + (last - row) * C,
                            true);
    __syncthreads();
  }
  if (all)
    publish_updates<T, C>(s, f, b.v + f.pivot_pad * C, 0, f.below);
  else if (!pivot)
    publish_updates<T, C>(s, f, b.v, row - f.pivot_pad, min(rows, f.below - (row - f.pivot_pad)));
}

}  // namespace

}  // namespace espalier::device::cuda

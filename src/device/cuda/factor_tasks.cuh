/// \file
/// The three kinds of tasks of the factorization. Each is carried out by one block of threads; all of its shared memory
/// is one area that serves in turn as scratch for assembly, as pipeline, and as operands of the last product.
#pragma once

#include "device/cuda/assemble.cuh"
#include "device/cuda/diagonal.cuh"
#include "device/cuda/place.cuh"
#include "espalier/types.hpp"

namespace espalier::device::cuda {

/// Where tasks come from, in shared memory. A block takes its next task when it has finished the arithmetic of the one
/// before, so the unfinished task with the lowest number is never held up by another.
struct TaskFeed {
  FactorTask task;
  Front front;
  void* base;  ///< of the front's region
  int stop;
  int id;
  int first, end;
  int* counter;
  unsigned waited;  ///< nanoseconds that the task has waited so far
};

/// What a task works with.
template <class T>
struct Workshop {
  const FactorState<T>* state;
  Pipeline<T> pipe;  ///< pipe.stages is the area
  TaskFeed* feed;
  int n;

  /// Start of the region in which the task's front lies.
  __device__ T* base() const { return static_cast<T*>(feed->base); }
};

/// Whether this device does the tasks of a stealable region; by one thread. The first block that asks finds out.
template <class T>
__device__ inline bool opened_here(const FactorState<T>& s, int region, unsigned owner) {
  const int k = region - s.first_stealable;
  int* opened = s.control + kOpened + k;
  int known = load_acquire(opened);
  if (known == 0 && atomicCAS(opened, 0, 3) == 0) {
    const bool mine = (owner >> s.peers.self & 1) != 0;
    const bool room = mine || atomicExch(s.control + kSlot, 1) == 0;
    const bool won = room && claim_devices(s.peers.control[0] + kClaims + k, s.peers.self + 1) == 0;
    if (room && !won && !mine) atomicExch(s.control + kSlot, 0);
    if (won) {
      T* base = mine ? s.peers.home[k] : s.spare;
      for (int d = 0; d < s.peers.count; ++d) store_pointer_devices(s.peers.base[d] + region, base);
      if (!mine) atomicAdd(s.control + kStolen, 1);
      fence_devices();
    }
    known = won ? 1 : 2;
    store_release(opened, known);
  }
  while (known == 0 || known == 3) {
    known = load_acquire(opened);
    if (aborted(s.control)) return false;
  }
  return known == 1;
}

/// One warp brings task `id` and its front.
template <class T>
__device__ inline void load_task(Workshop<T>& w, int id) {
  const FactorState<T>& s = *w.state;
  TaskFeed& feed = *w.feed;
  const int lane = static_cast<int>(threadIdx.x) & 31;
  FactorTask task;
  for (;;) {
    const bool ends = id >= feed.end || aborted(s.control);
    if (lane == 0) feed.stop = ends;
    if (ends) return;
    task = s.tasks[id];
    if (task.region < s.first_stealable) break;
    int here = 0;
    if (lane == 0) here = opened_here(s, task.region, s.fronts[task.front].members);
    if (__shfl_sync(0xffffffffu, here, 0) != 0) break;
    if (lane == 0) {  // all tasks of this sub-tree are another device's
      atomicMax(feed.counter, s.stealable_end[task.region - s.first_stealable] - feed.first);
      id = feed.first + atomicAdd(feed.counter, 1);
    }
    id = __shfl_sync(0xffffffffu, id, 0);
  }
  if (lane == 0) {
    feed.id = id;
    feed.task = task;
    feed.base = s.base[task.region];
  }
  const int* from = reinterpret_cast<const int*>(s.fronts + task.front);
  for (int x = lane; x < static_cast<int>(sizeof(Front) / sizeof(int)); x += 32)
    reinterpret_cast<int*>(&feed.front)[x] = from[x];
}

/// use(d) for every device d of the set; by all threads.
template <class Use>
__device__ inline void for_each_device(unsigned devices, Use&& use) {
  for (; devices != 0; devices &= devices - 1) use(__ffs(static_cast<int>(devices)) - 1);
}

/// The other devices that wait for what the task makes.
template <class T>
__device__ inline unsigned waiting_peers(const FactorState<T>& s, const Front& f, bool contribution) {
  if (s.peers.count == 1) return 0;
  return s.peers.others(contribution ? f.readers : f.region == 0 ? f.members : 0);
}

/// The other devices that need the pivots: all members in the top, the owner of a stolen sub-tree.
template <class T>
__device__ inline unsigned pivot_peers(const FactorState<T>& s, const Front& f) {
  return s.peers.count == 1 ? 0 : s.peers.others(f.members);
}

/// Makes the task's writes visible and sets its flags, first here, then, after push(d), at every device d of `peers`;
/// meanwhile warp 1 fetches the next task.
template <class T, class Push>
__device__ void finish_task(Workshop<T>& w, int front, std::int64_t flag, int part, bool both, unsigned peers,
                            Push&& push) {
  const FactorState<T>& s = *w.state;
  fence_copies();
  int id = 0;
  if (threadIdx.x == 32) id = w.feed->first + atomicAdd(w.feed->counter, 1);
  __syncthreads();
  if (threadIdx.x == 0) {
    if (s.peers.same_memory) fence_devices();
    store_release(s.flags(part) + flag, 1);
    if (both) store_release(s.flags(1) + flag, 1);
    add_release(s.finished + front, 1);
  }
  if (peers != 0) {
    for_each_device(peers, push);
    fence_copies();
    __syncthreads();
    if (threadIdx.x == 0) {
      fence_devices();
      for_each_device(peers, [&](int d) {
        int* flags = s.peers.flag[d] + flag;
        store_relaxed_devices(flags + part * s.part_flags, 1);
        if (both) store_relaxed_devices(flags + s.part_flags, 1);
      });
    }
  }
  if (threadIdx.x >= 32 && threadIdx.x < 64) load_task(w, __shfl_sync(0xffffffffu, id, 0));
}

/// Copies `count` elements, an even number, to the same place of the top on device d; by all threads.
template <class T>
__device__ inline void copy_to_peer(const FactorState<T>& s, int d, const T* from, std::int64_t count) {
  T* to = s.peers.top[d] + (from - s.peers.top[s.peers.self]);
  for (std::int64_t x = 2 * static_cast<int>(threadIdx.x); x < count; x += 2 * kThreads)
    *reinterpret_cast<PairOf<T>*>(to + x) = load_pair(from + x);
}

/// Pivots, and the inverse of D, of `count` positions from `position` on.
template <class T, Kind K>
__device__ inline void copy_pivots_to_peer(const FactorState<T>& s, int d, int position, int count, int n) {
  for (int x = threadIdx.x; x < count; x += kThreads)
    for (std::int64_t k = position + x; k < (K == Kind::ldlt ? 3 : 1) * static_cast<std::int64_t>(n); k += n)
      s.peers.pivot[d][k] = s.pivot[k];
}

/// Memory that this front takes over must no longer be read by those that had it before.
template <class T>
__device__ void wait_for_memory(const FactorState<T>& s, const Front& f) {
  for (int w = f.wait_begin + static_cast<int>(threadIdx.x); w < f.wait_end; w += kThreads)
    wait_for(s.finished + s.waits[w], s.fronts[s.waits[w]].tasks, s.control, s.patience);
  __syncthreads();
}

template <class T>
__device__ inline void zero_area(T* area, int count) {
  const PairOf<T> zero{};
  for (int x = threadIdx.x; x < count / 2; x += kThreads) reinterpret_cast<PairOf<T>*>(area)[x] = zero;
}

/// Array that holds A's operand (which 0) or B's (which 1) of a product for `part`; array 0 is L, array 1 the second
/// one.
template <Kind K>
__device__ constexpr int operand_array(int part, int which) {
  if (K == Kind::lu) return which == 0 ? part : 1 - part;
  return K == Kind::ldlt && which == 0 ? 1 : 0;
}
template <class T>
__device__ inline T* array_of(T* base, const Front& f, int array) {
  return base + (array == 0 ? f.factor : f.second);
}

/// Rows of a block task: padded row and count.
struct RowRange {
  int row, rows;
};
__device__ inline RowRange rows_of(const Front& f, const FactorTask& task) {
  const int j = task.column;
  const int row = max(f.block_begin(task.block), j < f.pivot_tiles ? f.column_end(j) : f.column_begin(j));
  return {row, f.block_end(task.block) - row};
}

/// What the task gathers, into the area.
template <class T, Kind K>
__device__ inline Target<T> target_of(const Front& f, const FactorTask& task, T* area) {
  Target<T> x{};
  const int j = task.column;
  x.to = area;
  if (task.work == Work::whole) {
    x.ld = f.total_pad + 4;
    x.tile_row_end = x.tile_col_end = f.tiles;
    x.gap = f.pivot_pad - f.pivots;
    x.square = K == Kind::lu;
    return x;
  }
  x.tile_col = j;
  x.tile_col_end = j + 1;
  x.col0 = tile_begin(f, j);
  if (task.work == Work::diagonal) {
    x.ld = f.width + 4;
    x.tile_row = j;
    x.tile_row_end = j + 1;
    x.square = K == Kind::lu;
  } else {
    const int per_block = kRowBlock / f.width, a = task.block;
    const int first = a < f.pivot_blocks ? a * per_block : f.pivot_tiles + (a - f.pivot_blocks) * per_block;
    x.ld = (rows_of(f, task).rows <= 64 ? 64 : 128) + 4;
    x.tile_row = max(first, j < f.pivot_tiles ? j + 1 : j);
    x.tile_row_end = min(first + per_block, a < f.pivot_blocks ? f.pivot_tiles : f.tiles);
    x.part = task.part;
  }
  x.row0 = tile_begin(f, x.tile_row);
  return x;
}

/// Rows of a diagonal or block task.
__device__ inline RowRange rows_of_tile(const Front& f, const FactorTask& task) {
  if (task.work == Work::block) return rows_of(f, task);
  const int row = f.column_begin(task.column);
  return {row, f.column_end(task.column) - row};
}

/// Entries and children into the area. Adds to `waited`, by one thread, the time that it had to wait for children.
/// @returns whether there was anything; if not, the area is left as it is
template <class T, Kind K>
__device__ inline bool gather(const FactorState<T>& s, const Front& f, const FactorTask& task, T* area,
                              unsigned& waited) {
  if (f.in_place()) {
    const auto [row, rows] = rows_of_tile(f, task);
    const int ld = task.work == Work::diagonal ? f.width + 4 : (rows <= 64 ? 64 : 128) + 4;
    zero_area(area, ld * f.width);
    __syncthreads();
    take_from_place(place_of_tile(s.base[f.region], f, task, row, rows), area, ld);
    __syncthreads();
    return true;
  }
  const Target<T> x = target_of<T, K>(f, task, area);
  if (x.tile_col >= f.pivot_tiles && f.link_begin == f.link_end) return false;
  zero_area(area, x.ld * (task.work == Work::whole ? f.total_pad : f.width));
  __syncthreads();
  const unsigned here = assemble<T, K == Kind::lu>(s, f, x);
  if (threadIdx.x == 0) waited += here;
  return true;
}

/// acc = -(what was gathered); leaves the area to the copy engine.
template <class T, class S>
__device__ inline void take_gathered(Accumulator<T, S>& acc, const T* area, bool any) {
  const Corner<S> at;
  for_each_element<S>(at,
                      [&](int m, int n, int e, int r, int c) { acc[m][n][e] = any ? -area[c * S::kLd + r] : T(0); });
  fence_copies();
  __syncthreads();
}

/// Largest magnitudes of L are compared with the bound; the columns that exceed it are marked.
template <class T>
__device__ inline void check_growth(const FactorState<T>& s, T bound, T l, int position) {
  if (!(l <= bound && l >= -bound)) {
    s.failed[position] = 1;
    s.control[kFailed] = 1;
  }
}

/// D^-1 applied to column c of a row vector: d[c] v(c) + e[c] v(c + 1) + e[c - 1] v(c - 1); e is zero where there are
/// no pairs.
template <class T, class Value>
__device__ inline T apply_inverse_d(const T* d, const T* e, int c, Value&& v) {
  T x = d[c] * v(c);
  if (e[c] != T(0)) x += e[c] * v(c + 1);
  if (c > 0 && e[c - 1] != T(0)) x += e[c - 1] * v(c - 1);
  return x;
}

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
    fence_copies();
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
  if (at.row < rows && at.col < cols)
    for (int q = 0; q < cols / kChunk; ++q)
      multiply_chunk<T, S>(acc, x + q * S::kRows * kChunk, m + q * cols * kChunk, at);
}

/// One row block of a tile column, in S::kRows x S::kWidth at most.
template <class T, Kind K, class S>
__device__ void block_task(Workshop<T>& w, const Front& f, const FactorTask& task, bool any) {
  const FactorState<T>& s = *w.state;
  const Corner<S> at;
  const int j = task.column, a = task.block, part = task.part;
  const bool pivot = j < f.pivot_tiles;
  const int col = f.column_begin(j), cols = f.column_end(j) - col;
  const auto [row, rows] = rows_of(f, task);
  T acc[S::kM][S::kN][4];
  take_gathered<T, S>(acc, w.pipe.stages, any);
  const int from_a = operand_array<K>(part, 0), from_b = operand_array<K>(part, 1);
  const int* flag_a = s.flags(K == Kind::lu ? from_a : 0) + f.flag(a, 0);
  const int* flag_b = s.flags(K == Kind::lu ? from_b : 0) + f.flag(f.block_of_column(j), 0);
  const Operand<T> left{array_of(w.base(), f, from_a), row, rows}, right{array_of(w.base(), f, from_b), col, cols};
  sum_products<T, S>(acc, f, left, right, false, (pivot ? col : f.pivot_pad) / kChunk, flag_a, flag_b, f.blocks, w.pipe,
                     s.control, s.patience);
  if (!pivot) {
    const int r0 = row - f.pivot_pad, c0 = col - f.pivot_pad;
    const std::int64_t ld = f.below_ld - c0;
    T* to = f.first_place >= 0
                ? s.places[f.place(j - f.pivot_tiles, part)]
                : w.base() + (part == 0 ? f.contribution : f.contribution_up) + f.contribution_offset(c0, c0);
    for_each_element<S>(at, [&](int m, int n, int e, int r, int c) {
      if (r < rows && c < cols && r0 + r < f.below && c0 + c < f.below && r0 + r >= c0 + c)
        to[c * ld + (r0 - c0) + r] = -acc[m][n][e];
    });
    finish_task(w, task.front, f.flag(a, j), part, false, waiting_peers(s, f, true), [](int) {});
  } else {
    const std::int64_t stride = static_cast<std::int64_t>(f.total_pad - j * f.width) * kChunk;
    const int q = col / kChunk;
    const int inverse = K == Kind::lu ? 1 - part : 0;  // L = C inverse(U), U^T = C P^T inverse(L)^T
    multiply_by_inverse<T, S>(acc, w, array_of(w.base(), f, inverse) + f.chunk_offset(q, col), stride, rows, cols,
                              s.flags(0) + f.diagonal_flag(j));
    T* const base = w.base();
    T* to = array_of(base, f, part) + f.chunk_offset(q, row);
    const unsigned peers = waiting_peers(s, f, false);
    if constexpr (K == Kind::ldlt) {
      T* second = array_of(base, f, 1) + f.chunk_offset(q, row);
      store_panels<T, S>(acc, T(1), second, stride, rows, cols, at);
      for_each_device(peers, [&](int d) {
        store_panels<T, S>(acc, T(1), s.peers.top[d] + (second - base), stride, rows, cols, at);
      });
      multiply_by_inverse_d<T, S>(acc, s, w.pipe.stages, f.position + col, f.pivots - col);
    }
    if constexpr (K != Kind::llt) {
      const T bound = s.growth();
      if (part == 0)
        for_each_element<S>(at, [&](int m, int n, int e, int r, int c) {
          if (r < rows && col + c < f.pivots && c < cols) check_growth(s, bound, acc[m][n][e], f.position + col + c);
        });
    }
    store_panels<T, S>(acc, T(1), to, stride, rows, cols, at);
    finish_task(w, task.front, f.flag(a, j), part, false, peers,
                [&](int d) { store_panels<T, S>(acc, T(1), s.peers.top[d] + (to - base), stride, rows, cols, at); });
  }
}

/// Inverses of a diagonal tile's factors, in shared memory: A (size x size) is destroyed, M goes to the factor array,
/// the transposed inverse of U (lu) to the second one. On return m holds the last one written; between the two,
/// use_lower().
template <class T, Kind K, class Use>
__device__ void invert_pivot_block(const FactorState<T>& s, T* base, const Front& f, int col, T* a, int lda, int size,
                                   T* m, int ldm, int n, Use&& use_lower) {
  const int pivots = min(f.pivots - col, size), q = col / kChunk;
  const std::int64_t stride = static_cast<std::int64_t>(f.total_pad - col) * kChunk;
  const PivotSink<T> sink{&s, f.position + col, n};
  if constexpr (K == Kind::llt) {
    for (int x = pivots + static_cast<int>(threadIdx.x); x < size; x += kThreads) a[x * lda + x] = T(1);
    __syncthreads();
    invert_cholesky(a, lda, size, pivots, m, ldm, sink);
  } else if constexpr (K == Kind::ldlt) {
    invert_ldlt(a, lda, size, pivots, m, ldm, sink);
  } else {
    invert_lower_lu(a, lda, size, pivots, m, ldm, sink);
  }
  write_panels(m, 1, ldm, size, size, array_of(base, f, 0) + f.chunk_offset(q, col), stride);
  use_lower();
  if constexpr (K == Kind::lu) {
    __syncthreads();
    invert_upper_lu(a, lda, size, pivots, m, ldm);
    write_panels(m, 1, ldm, size, size, array_of(base, f, 1) + f.chunk_offset(q, col), stride);
  }
}

/// The diagonal tile of a pivot column, up to its factorization: what was gathered loses the products to its left.
template <class T, Kind K, int Width>
__device__ void subtract_from_diagonal(Workshop<T>& w, const Front& f, int j) {
  using S = Shape<Width, Width>;
  const FactorState<T>& s = *w.state;
  const Corner<S> at;
  const int col = f.column_begin(j), size = f.column_end(j) - col;
  T acc[S::kM][S::kN][4];
  take_gathered<T, S>(acc, w.pipe.stages, true);
  const int a = f.block_of_column(j);
  const int from_a = operand_array<K>(0, 0), from_b = operand_array<K>(0, 1);
  const int* flag_a = s.flags(0) + f.flag(a, 0);
  const int* flag_b = s.flags(K == Kind::lu ? 1 : 0) + f.flag(a, 0);
  const Operand<T> left{array_of(w.base(), f, from_a), col, size}, right{array_of(w.base(), f, from_b), col, size};
  sum_products<T, S>(acc, f, left, right, K == Kind::llt, col / kChunk, flag_a, flag_b, f.blocks, w.pipe, s.control,
                     s.patience);
  T* c = w.pipe.stages;
  for_each_element<S>(at, [&](int m, int n, int e, int r, int k) {
    if (r < size && k < size) c[k * S::kLd + r] = -acc[m][n][e];
  });
  __syncthreads();
}

/// out = in M^T for the strip of 16 rows at `strip` (element (r, k) at strip[r * sr + k * sk]), in place, by one warp.
template <class T>
__device__ void strip_times_inverse(T* strip, int sr, int sk, const T* m, int ldm, int size) {
  T c[8][4] = {};
#pragma unroll
  for (int n = 0; n < 8; ++n)
    if (8 * n < size)
      for (int k = 0; k < size; k += 16) multiply_shared(c[n], strip + k * sk, sr, sk, m + k * ldm + 8 * n, ldm, 1);
  __syncwarp();
#pragma unroll
  for (int n = 0; n < 8; ++n)
    if (8 * n < size) put_shared(c[n], T(1), false, strip + 8 * n * sk, sr, sk);
  __syncwarp();
}

/// Writes a whole front's contribution from its scratch tile.
template <class T, Kind K>
__device__ void write_contribution(const FactorState<T>& s, T* base, const Front& f, const T* a, int ld) {
  const int warp = static_cast<int>(threadIdx.x) >> 5, lane = static_cast<int>(threadIdx.x) & 31, p = f.pivot_pad;
  for (int c = warp; c < f.below; c += 4) {
    T* to = (f.first_place >= 0 ? s.places[f.place(0, 0)] : base + f.contribution) +
            static_cast<std::int64_t>(c) * f.below_ld;
    for (int r = c + lane; r < f.below; r += 32) to[r] = a[(p + c) * ld + p + r];
    if constexpr (K == Kind::lu) {
      T* up = (f.first_place >= 0 ? s.places[f.place(0, 1)] : base + f.contribution_up) +
              static_cast<std::int64_t>(c) * f.below_ld;
      for (int r = c + 1 + lane; r < f.below; r += 32) up[r] = a[(p + r) * ld + p + c];
    }
  }
}

/// A whole small front with symmetric values: its rows below times the transposed inverse M go to the columns to the
/// right of the pivots, transposed: L for llt, L D for ldlt, where L replaces the rows below. Ends with a barrier.
template <class T, Kind K>
__device__ void multiply_below(const FactorState<T>& s, const Front& f, T* a, const T* m) {
  const int warp = static_cast<int>(threadIdx.x) >> 5, lane = static_cast<int>(threadIdx.x) & 31;
  const int p = f.pivot_pad, ld = f.total_pad + 4, ldm = p + 4, below = f.total_pad - p;
  T* low = a + p;
  T* up = a + p * ld;
#pragma unroll 1
  for (int y = warp; y < below / 16 * (p / 8); y += kThreads / 32) {  // pieces of 16 x 8
    const int i = 16 * (y / (p / 8)), n = 8 * (y % (p / 8));
    T c[4] = {};
#pragma unroll 1
    for (int k = 0; k < p; k += 16) multiply_shared(c, low + k * ld + i, 1, ld, m + k * ldm + n, ldm, 1);
    put_shared(c, T(1), false, up + i * ld + n, ld, 1);
  }
  __syncthreads();
  if (K == Kind::llt) return;
  const T* d = a + kInverseD * ld;
  const T* e = a + kInverseE * ld;
  const T bound = s.growth();
  for (int k = warp; k < f.pivots; k += kThreads / 32)
    for (int r = lane; r < below; r += 32) {
      const T l = apply_inverse_d(d, e, k, [&](int c) { return up[r * ld + c]; });
      low[k * ld + r] = l;
      if (r < f.below) check_growth(s, bound, l, f.position + k);
    }
  __syncthreads();
}

/// The rest of a whole small front in shared memory, after its pivot block was inverted: M is the last inverse.
template <class T, Kind K>
__device__ void finish_whole(Workshop<T>& w, const Front& f, const FactorTask& task) {
  const FactorState<T>& s = *w.state;
  const int warp = static_cast<int>(threadIdx.x) >> 5;
  const int p = f.pivot_pad, size = f.total_pad, ld = size + 4, ldm = p + 4, strips = (size - p) / 16;
  T* a = w.pipe.stages;
  const T* m = a + ld * size;
  T* low = a + p;      // rows below, pivot columns: element (r, k) at low[k * ld + r]
  T* up = a + p * ld;  // pivot rows, columns below: element (k, c) at up[c * ld + k]
  __syncthreads();
  if constexpr (K == Kind::lu) {
    for (int i = warp; i < strips; i += 4) strip_times_inverse(low + 16 * i, 1, ld, m, ldm, p);
    __syncthreads();
    const T bound = s.growth();
    for (int k = warp; k < f.pivots; k += 4)
      for (int r = static_cast<int>(threadIdx.x) & 31; r < f.below; r += 32)
        check_growth(s, bound, low[k * ld + r], f.position + k);
  } else {
    multiply_below<T, K>(s, f, a, m);
  }
  const std::int64_t stride = static_cast<std::int64_t>(size) * kChunk;
  if (strips > 0) {
    write_panels(K == Kind::llt ? up : low, K == Kind::llt ? ld : 1, K == Kind::llt ? 1 : ld, size - p, p,
                 array_of(w.base(), f, 0) + f.chunk_offset(0, p), stride);
    if constexpr (K == Kind::lu)
      write_panels(up, ld, 1, size - p, p, array_of(w.base(), f, 1) + f.chunk_offset(0, p), stride);
  }
  // A22 -= A21 B12: L L^T, L (L D)^T or L U.
  for (int y = warp; y < 2 * strips * strips; y += 4) {
    const int h = y & 1, i = 16 * ((y >> 1) / strips), j = 16 * ((y >> 1) % strips) + 8 * h;
    if (K != Kind::lu && j > i + 8) continue;
    T c[4] = {};
#pragma unroll 1
    for (int k = 0; k < p; k += 16)
      multiply_shared(c, K == Kind::llt ? up + i * ld + k : low + k * ld + i, K == Kind::llt ? ld : 1,
                      K == Kind::llt ? 1 : ld, up + j * ld + k, 1, ld);
    put_shared(c, T(-1), true, a + (p + j) * ld + p + i, 1, ld);
  }
  __syncthreads();
  if (f.below > 0) write_contribution<T, K>(s, w.base(), f, a, ld);
  const std::int64_t flag = f.below > 0 ? f.flag(f.pivot_blocks, f.pivot_tiles) : f.diagonal_flag(0);
  finish_task(w, task.front, flag, 0, K == Kind::lu, waiting_peers(s, f, true) | pivot_peers(s, f), [&](int d) {
    if ((f.members >> d & 1) == 0) return;
    if (f.region == 0)
      for (int k = 0; k < (K == Kind::lu ? 2 : 1); ++k) copy_to_peer(s, d, array_of(w.base(), f, k), f.factor_size());
    copy_pivots_to_peer<T, K>(s, d, f.position, f.pivots, w.n);
  });
}

/// A diagonal tile, or a whole front.
template <class T, Kind K, bool Wide>
__device__ void pivot_task(Workshop<T>& w, const Front& f, const FactorTask& task) {
  const FactorState<T>& s = *w.state;
  const bool whole = task.work == Work::whole;
  const int j = task.column, col = f.column_begin(j), size = f.column_end(j) - col;
  if (!whole) {
    if (Wide && f.width == 64)
      subtract_from_diagonal<T, K, 64>(w, f, j);
    else
      subtract_from_diagonal<T, K, 32>(w, f, j);
  }
  T* a = w.pipe.stages;
  const int lda = whole ? f.total_pad + 4 : f.width + 4, ldm = whole ? size + 4 : f.width + 4;
  T* m = a + lda * (whole ? f.total_pad : f.width);
  invert_pivot_block<T, K>(s, w.base(), f, col, a, lda, size, m, ldm, w.n, [&] {
    if constexpr (K == Kind::lu) {  // U12^T = A12^T P^T inverse(L)^T
      const int strips = whole ? (f.total_pad - size) / 16 : 0;
      for (int i = static_cast<int>(threadIdx.x) >> 5; i < strips; i += 4)
        strip_times_inverse(a + size * lda + 16 * i * lda, lda, 1, m, ldm, size);
    }
  });
  if (whole) {
    finish_whole<T, K>(w, f, task);
    return;
  }
  finish_task(w, task.front, f.diagonal_flag(j), 0, false, pivot_peers(s, f), [&](int d) {
    const std::int64_t stride = static_cast<std::int64_t>(f.total_pad - col) * kChunk;
    if (f.region == 0)
      for (int k = 0; k < (K == Kind::lu ? 2 : 1); ++k)
        for (int q = 0; q < size / kChunk; ++q)
          copy_to_peer(s, d, array_of(w.base(), f, k) + f.chunk_offset(col / kChunk, col) + q * stride,
                       static_cast<std::int64_t>(size) * kChunk);
    copy_pivots_to_peer<T, K>(s, d, f.position + col, min(f.pivots - col, size), w.n);
  });
}

}  // namespace espalier::device::cuda

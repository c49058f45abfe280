/// \file
/// The body of the persistent solve kernel. Every number of the factor is read once on the way up and once on the way
/// down, 16 bytes a lane, in the order in which it lies in memory.
#pragma once

#include <algorithm>

#include "device/cuda/intrinsics.cuh"
#include "device/cuda/products.cuh"
#include "device/cuda/solve_kernel.cuh"

namespace espalier::device::cuda {

namespace {

// ---- values handed from block to block -----------------------------------------------------------------------------

__device__ inline bool is_missing(double v) { return __double_as_longlong(v) == -1LL; }
__device__ inline bool is_missing(float v) { return __float_as_int(v) == -1; }
__device__ inline double load_shared_value(const double* p) {
  double v;
  asm volatile("ld.relaxed.sys.global.f64 %0,[%1];" : "=d"(v) : "l"(p) : "memory");
  return v;
}
__device__ inline float load_shared_value(const float* p) {
  float v;
  asm volatile("ld.relaxed.sys.global.f32 %0,[%1];" : "=f"(v) : "l"(p) : "memory");
  return v;
}
__device__ inline void publish(double* p, double v) {
  if (is_missing(v)) v = __longlong_as_double(0x7ff8000000000000LL);
  asm volatile("st.relaxed.sys.global.f64 [%0],%1;" ::"l"(p), "d"(v) : "memory");
}
__device__ inline void publish(float* p, float v) {
  if (is_missing(v)) v = __int_as_float(0x7fc00000);
  asm volatile("st.relaxed.sys.global.f32 [%0],%1;" ::"l"(p), "f"(v) : "memory");
}

/// The value at p once it is there. After an abort: whatever is there.
template <class T>
__device__ __forceinline__ T await_slowly(const T* p, int* control, std::uint64_t patience) {
  const std::uint64_t start = global_nanoseconds();
  for (int n = 1;; ++n) {
    const T v = load_shared_value(p);
    if (!is_missing(v)) return v;
    if ((n & 15) == 0) {
      if (load_relaxed(control + 1) != 0) return v;
      if (global_nanoseconds() - start > patience) atomicExch(control + 1, 1);
    }
  }
}
template <class T>
__device__ __forceinline__ T await(const T* p, int* control, std::uint64_t patience) {
  const T v = load_shared_value(p);
  return is_missing(v) ? await_slowly(p, control, patience) : v;
}

template <class T>
__device__ inline PairOf<T> stream_pair(const T* p) {
  return __ldcs(reinterpret_cast<const PairOf<T>*>(p));
}

constexpr int kLargeThreads = 256;  ///< of a block that takes row blocks: a warp has 16 rows, or 16 columns
constexpr int kSmallThreads = 128;  ///< of a block that takes whole small fronts
constexpr int kSmallPerMultiprocessor = 8;
/// More blocks of the large phase would have to do with fewer registers: elasticity 40 takes 1.9 ms with 2 of them, 2.4
/// with 3, 3.2 with 4; 32 right-hand sides 16.0 ms with 1, 21.1 with 2.
constexpr int kLargePerMultiprocessor = 2;
constexpr int kManyPerMultiprocessor = 1;
__device__ inline int threads() { return static_cast<int>(blockDim.x); }
__device__ inline int warps() { return static_cast<int>(blockDim.x) / 32; }

/// Rows: of the block's part of the vector; more than a row block for whole fronts on the way up, which need no values
/// of other blocks.
template <class T, int Columns, int Rows>
struct SolveBench {
  T v[Rows * Columns];                                 ///< the block's part of the vector
  T x[Rows > kRowBlock ? 1 : 2 * kRowBlock* Columns];  ///< finished values of other blocks, two groups in turn; partial
                                                       ///< sums
  T y[kRowBlock * Columns];                            ///< finished values of the block
  std::int64_t child_rows[32];                         ///< children to gather from: place of the first row below
  int child_begin[32], child_end[32];                  ///< their rows that fall into the block
  int children;
  int next;
  Front front;
};

__device__ inline int lane_of_thread() { return static_cast<int>(threadIdx.x) & 31; }
__device__ inline int warp_of_thread() { return static_cast<int>(threadIdx.x) >> 5; }

/// Asks for the lines of [p, p + count) to be brought into the L2 cache; by all threads.
template <class T>
__device__ inline void prefetch(const T* p, int count) {
  constexpr int kLine = 128 / sizeof(T);
  for (int k = static_cast<int>(threadIdx.x) * kLine; k < count; k += threads() * kLine)
    asm volatile("prefetch.global.L2 [%0];" ::"l"(p + k));
}

/// Sum over the four lanes that share a row of a panel; all four get it.
template <class T>
__device__ inline T sum_over_columns(T x) {
  x += __shfl_xor_sync(0xffffffffu, x, 1);
  return x + __shfl_xor_sync(0xffffffffu, x, 2);
}
/// Sum over the eight lanes that share a column of a panel; all eight get it.
template <class T>
__device__ inline T sum_over_rows(T x) {
  x += __shfl_xor_sync(0xffffffffu, x, 4);
  x += __shfl_xor_sync(0xffffffffu, x, 8);
  return x + __shfl_xor_sync(0xffffffffu, x, 16);
}

/// Whether sums for C columns are made by tensor cores on the way up.
template <class T, int C>
inline constexpr bool kTensors = C == 8 && sizeof(T) == 8;

/// sum (16 x 8) += L (16 x 16) x (16 x 8); L: two panels as they lie in memory, x row-major.
template <class T>
__device__ inline void multiply_eight(T (&sum)[4], const PairOf<T> (&l)[2][2], const T* x) {
  const int lane = lane_of_thread(), g = lane >> 2, t = lane & 3;
  T left[8], right[4];
#pragma unroll
  for (int p = 0; p < 2; ++p)
#pragma unroll
    for (int h = 0; h < 2; ++h) {
      left[4 * h + p] = l[p][h].x;
      left[4 * h + 2 + p] = l[p][h].y;
    }
#pragma unroll
  for (int u = 0; u < 4; ++u) right[u] = x[(4 * u + t) * 8 + g];
  multiply_add(sum, left, right);
}

// ---- up ------------------------------------------------------------------------------------------------------------

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

// ---- down ----------------------------------------------------------------------------------------------------------

/// Place of padded row r of the front in the solution; -1 for padding.
template <class T>
__device__ inline int position_of_row(const SolveState<T>& s, const Front& f, int r) {
  if (r < f.pivot_pad) return r < f.pivots ? f.position + r : -1;
  return r - f.pivot_pad < f.below ? s.rows[f.rows + r - f.pivot_pad] : -1;
}

/// v -= L(rows from `from` on, columns of the block)^T x, from the last group of 128 rows up: what is known first comes
/// first. A warp has 16 columns, or, where there are too few, half or a quarter of every group's rows of them.
template <class T, int C, int R>
__device__ void subtract_below(const SolveState<T>& s, SolveBench<T, C, R>& b, const T* factor, int col, int cols,
                               int from) {
  const Front& f = b.front;
  const int lane = lane_of_thread(), g = lane >> 2, t = lane & 3;
  constexpr int kAtOnce = C == 1 ? 4 : 2;  // panels in registers
  constexpr int kPerGroup = kRowBlock / kPanel;
  const int panels = (f.total_pad - from) / kPanel;
  if (panels == 0) return;
  const int parts = 4 * cols <= warps() * kChunk ? 4 : (2 * cols <= warps() * kChunk ? 2 : 1);
  const int each = warps() / parts, warp = warp_of_thread() % each, part = warp_of_thread() / each;
  const int span = kPerGroup / parts, low = part * span;
  const bool mine = warp * kChunk < cols;
  const T* base = factor + f.chunk_offset(col / kChunk + (mine ? warp : 0), from) + lane * 2;
  T acc[4][C] = {};
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
    T* x = b.x + (k & 1) * kRowBlock * C;
    for (int y = threadIdx.x; y < kRowBlock * C; y += threads()) {
      const int r = from + k * kRowBlock + y / C, at = r < f.total_pad ? position_of_row(s, f, r) : -1;
      x[y] = at >= 0 ? await(s.solution + static_cast<std::int64_t>(at) * C + y % C, s.control, s.patience) : T(0);
    }
    __syncthreads();
    if (!mine) continue;
#pragma unroll 1
    for (int p0 = low + span - kAtOnce; p0 >= low; p0 -= kAtOnce) {
#pragma unroll
      for (int p = 0; p < kAtOnce; ++p) {
#pragma unroll
        for (int c = 0; c < C; ++c) {
          const T z = x[((p0 + p) * kPanel + g) * C + c];
          acc[0][c] += l[p][0].x * z;
          acc[1][c] += l[p][0].y * z;
          acc[2][c] += l[p][1].x * z;
          acc[3][c] += l[p][1].y * z;
        }
      }
      load(p0 > low ? k * kPerGroup + p0 - kAtOnce : (k - 1) * kPerGroup + low + span - kAtOnce);
    }
  }
  if (parts > 1) __syncthreads();
  T* to = parts > 1 ? b.x + part * cols * C : b.v;
#pragma unroll
  for (int u = 0; u < 4; ++u)
#pragma unroll
    for (int c = 0; c < C; ++c) {
      const T sum = sum_over_rows(acc[u][c]);
      T& at = to[(warp * kChunk + 4 * u + t) * C + c];
      if (mine && g == 0) at = parts > 1 ? sum : at - sum;
    }
  if (parts == 1) return;
  __syncthreads();
  for (int y = threadIdx.x; y < cols * C; y += threads()) {
    T sum = b.x[y];
    for (int p = 1; p < parts; ++p) sum += b.x[p * cols * C + y];
    b.v[y] -= sum;
  }
}

/// Partial sums of A^T in for `rows` x `cols` (at most 64) panels at `a`: part[h * 64 * C + ...] over the panels of
/// half h. value(r, c): element of `in`.
template <class T, int C, class Value>
__device__ void multiply_panels_transposed(const T* a, std::int64_t stride, int rows, int cols, T* part,
                                           Value&& value) {
  const int lane = lane_of_thread(), g = lane >> 2, t = lane & 3;
  const int chunks = cols / kChunk, panels = rows / kPanel, half = (panels + 1) / 2;
  for (int unit = warp_of_thread(); unit < 2 * chunks; unit += warps()) {
    const int q = unit >> 1, h = unit & 1, end = h == 0 ? half : panels;
    T acc[4][C] = {};
    for (int p0 = h * half; p0 < end; p0 += 4) {
      PairOf<T> l[4][2];
#pragma unroll
      for (int p = 0; p < 4; ++p)
        if (p0 + p < end) {
          l[p][0] = load_pair(a + q * stride + (p0 + p) * 128 + lane * 2);
          l[p][1] = load_pair(a + q * stride + (p0 + p) * 128 + lane * 2 + 64);
        }
#pragma unroll
      for (int p = 0; p < 4; ++p)
        if (p0 + p < end)
#pragma unroll
          for (int c = 0; c < C; ++c) {
            const T z = value(kPanel * (p0 + p) + g, c);
            acc[0][c] += l[p][0].x * z;
            acc[1][c] += l[p][0].y * z;
            acc[2][c] += l[p][1].x * z;
            acc[3][c] += l[p][1].y * z;
          }
    }
#pragma unroll
    for (int u = 0; u < 4; ++u)
#pragma unroll
      for (int c = 0; c < C; ++c) {
        const T sum = sum_over_rows(acc[u][c]);
        if (g == 0) part[(h * 64 + q * kChunk + 4 * u + t) * C + c] = sum;
      }
  }
}

/// v = the forward solution of the block, times D^-1 for ldlt; zero in the padding.
template <class T, int C, int R>
__device__ void take_forward(const SolveState<T>& s, SolveBench<T, C, R>& b, int col, int cols) {
  const Front& f = b.front;
  for (int y = threadIdx.x; y < kRowBlock * C; y += threads()) {
    const bool real = y / C < cols && col + y / C < f.pivots;
    const std::int64_t at = static_cast<std::int64_t>(f.position + col) * C + y;
    const T v = real ? await(s.forward + at, s.control, s.patience) : T(0);
    (s.inverse_d != nullptr ? b.y : b.v)[y] = v;
  }
  if (s.inverse_d == nullptr) return;
  __syncthreads();
  for (int y = threadIdx.x; y < kRowBlock * C; y += threads()) {
    const int k = y / C, position = f.position + col + k;
    T v = T(0);
    if (k < cols && col + k < f.pivots) {
      v = s.inverse_d[position] * b.y[y];
      const T e = s.inverse_e[position];
      if (e != T(0)) v += e * b.y[y + C];
      const T before = col + k > 0 ? s.inverse_e[position - 1] : T(0);
      if (before != T(0) && k > 0) v += before * b.y[y - C];
    }
    b.v[y] = v;
  }
}

/// One row block of pivots.
template <class T, int C, int R>
__device__ void go_down(const SolveState<T>& s, SolveBench<T, C, R>& b, int a, int first_column) {
  const Front& f = b.front;
  const int col = f.block_begin(a), end = f.block_end(a), cols = end - col;
  const int per_block = kRowBlock / f.width, tile = a * per_block;
  const T* factor = s.base[f.region] + (s.down_second ? f.second : f.factor);
  for (int q = 0; q < cols / kChunk; ++q) {  // what comes last, and is waited for by others
    const int first = col / kChunk + q, top = col + q * kChunk / f.width * f.width;
    prefetch(factor + f.chunk_offset(first, top), (min(end + kRowBlock, f.total_pad) - top) * kChunk);
  }
  take_forward(s, b, col, cols);
  __syncthreads();
  subtract_below(s, b, factor, col, cols, end);
  __syncthreads();
  T* left = b.x;              // partial sums over the rows of the block after the tile
  T* own = b.x + 2 * 64 * C;  // partial sums of the product with the inverse
  for (int j = min(tile + per_block, f.pivot_tiles) - 1; j >= tile; --j) {
    const int c0 = f.column_begin(j), c1 = f.column_end(j), size = c1 - c0, q = c0 / kChunk;
    const std::int64_t stride = static_cast<std::int64_t>(f.total_pad - j * f.width) * kChunk;
    const bool more = c1 < end;
    const T* v = b.v + (c0 - col) * C;
    const T* x = b.y + (c1 - col) * C;
    if (more) {
      multiply_panels_transposed<T, C>(factor + f.chunk_offset(q, c1), stride, end - c1, size, left,
                                       [&](int r, int c) { return x[r * C + c]; });
      __syncthreads();
    }
    multiply_panels_transposed<T, C>(factor + f.chunk_offset(q, c0), stride, size, size, own, [&](int r, int c) {
      const int k = r * C + c;
      return more ? v[k] - (left[k] + left[64 * C + k]) : v[k];
    });
    __syncthreads();
    const int real = min(size, f.pivots - c0);
    for (int y = threadIdx.x; y < size * C; y += threads()) {
      const T value = own[y] + own[64 * C + y];
      b.y[(c0 - col) * C + y] = value;
      if (y >= real * C) continue;
      publish(s.solution + static_cast<std::int64_t>(f.position + c0) * C + y, value);
      if (first_column + y % C < s.columns && s.speaks_for(f))
        s.result[static_cast<std::int64_t>(f.position + c0 + y / C) * s.columns + first_column + y % C] = value;
    }
    __syncthreads();
  }
}

/// Which fronts a kernel takes: small sub-trees on the way up, all others up and down, small sub-trees on the way down.
enum class Phase { small_up, large, small_down };

template <class T, int C, Phase P>
__global__ void __launch_bounds__(P == Phase::large ? kLargeThreads : kSmallThreads,
                                  P == Phase::large ? (C == 1 ? kLargePerMultiprocessor : kManyPerMultiprocessor)
                                                    : (C == 1 ? kSmallPerMultiprocessor : 3))
    solve_kernel(const __grid_constant__ SolveState<T> s, int first_column) {
  constexpr int kRows = P == Phase::small_up ? kSmallRows : kRowBlock;
  __shared__ SolveBench<T, C, kRows> b;
  const int first_up = P == Phase::large ? s.small_up : 0;
  const int ups = P == Phase::small_up ? s.small_up : (P == Phase::large ? s.up_tasks - s.small_up : 0);
  const int first_down = P == Phase::small_down ? s.down_tasks - s.small_down : 0;
  const int downs = P == Phase::small_down ? s.small_down : (P == Phase::large ? s.down_tasks - s.small_down : 0);
  for (;;) {
    __syncthreads();
    if (threadIdx.x == 0)
      b.next = load_relaxed(s.control + 1) != 0 ? ups + downs : atomicAdd(s.control + 2 + static_cast<int>(P), 1);
    __syncthreads();
    const int id = b.next;
    if (id >= ups + downs) {
      if (threadIdx.x == 0 && s.devices > 1 && load_relaxed(s.control + 1) != 0)
        for (int d = 0; d < s.devices; ++d) store_relaxed_devices(s.peer_control[d] + 1, 1);
      return;
    }
    const SolveTask task = id < ups ? s.up[first_up + id] : s.down[first_down + id - ups];
    const int* from = reinterpret_cast<const int*>(s.fronts + task.front);
    for (int x = threadIdx.x; x < static_cast<int>(sizeof(Front) / sizeof(int)); x += threads())
      reinterpret_cast<int*>(&b.front)[x] = from[x];
    __syncthreads();
    if constexpr (P == Phase::small_up)
      go_up<T, C, kRows>(s, b, -1, first_column);
    else if (P == Phase::large && id < ups)
      go_up<T, C, kRows>(s, b, task.block, first_column);
    else
      go_down<T, C, kRows>(s, b, task.block, first_column);
  }
}

template <class T>
__global__ void copy_kernel(T* to, const T* from, std::int64_t count) {
  const std::int64_t step = static_cast<std::int64_t>(gridDim.x) * blockDim.x;
  for (std::int64_t x = static_cast<std::int64_t>(blockIdx.x) * blockDim.x + threadIdx.x; x < count; x += step)
    to[x] = from[x];
}

template <class T, int C, class Use>
cudaError_t for_each_phase(const Use& use) {
  if (const auto e = use(solve_kernel<T, C, Phase::small_up>, 0, kSmallThreads)) return e;
  if (const auto e = use(solve_kernel<T, C, Phase::large>, 1, kLargeThreads)) return e;
  return use(solve_kernel<T, C, Phase::small_down>, 2, kSmallThreads);
}

}  // namespace

template <class T>
cudaError_t SolveKernel<T>::resident(bool many, SolveShape& shape) {
  int device = 0, multiprocessors = 0;
  if (const auto e = cudaGetDevice(&device)) return e;
  if (const auto e = cudaDeviceGetAttribute(&multiprocessors, cudaDevAttrMultiProcessorCount, device)) return e;
  const auto ask = [&](auto* kernel, int phase, int block) {
    int each = 0;
    const auto e = cudaOccupancyMaxActiveBlocksPerMultiprocessor(&each, kernel, block, 0);
    shape.blocks[phase] = each * multiprocessors;
    return e;
  };
  return many ? for_each_phase<T, kManyColumns>(ask) : for_each_phase<T, 1>(ask);
}

template <class T>
cudaError_t launch_copy(T* to, const T* from, std::int64_t count, cudaStream_t stream) {
  constexpr int kBlock = 512;
  const auto blocks = std::min<std::int64_t>((count + kBlock - 1) / kBlock, 528);
  if (count > 0) copy_kernel<<<static_cast<int>(blocks), kBlock, 0, stream>>>(to, from, count);
  return cudaGetLastError();
}

template <class T>
cudaError_t SolveKernel<T>::launch(bool many, const SolveShape& shape, const SolveState<T>& state, int first_column,
                                   cudaStream_t stream) {
  const int tasks[3] = {state.small_up, state.up_tasks - state.small_up + state.down_tasks - state.small_down,
                        state.small_down};
  const auto start = [&](auto* kernel, int phase, int block) {
    if (tasks[phase] == 0) return cudaSuccess;
    kernel<<<std::min(shape.blocks[phase], tasks[phase]), block, 0, stream>>>(state, first_column);
    return cudaGetLastError();
  };
  return many ? for_each_phase<T, kManyColumns>(start) : for_each_phase<T, 1>(start);
}

}  // namespace espalier::device::cuda

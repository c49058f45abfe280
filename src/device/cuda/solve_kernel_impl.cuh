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
  asm volatile("ld.relaxed.gpu.global.f64 %0,[%1];" : "=d"(v) : "l"(p) : "memory");
  return v;
}
__device__ inline float load_shared_value(const float* p) {
  float v;
  asm volatile("ld.relaxed.gpu.global.f32 %0,[%1];" : "=f"(v) : "l"(p) : "memory");
  return v;
}
__device__ inline void publish(double* p, double v) {
  if (is_missing(v)) v = __longlong_as_double(0x7ff8000000000000LL);
  asm volatile("st.relaxed.gpu.global.f64 [%0],%1;" ::"l"(p), "d"(v) : "memory");
}
__device__ inline void publish(float* p, float v) {
  if (is_missing(v)) v = __int_as_float(0x7fc00000);
  asm volatile("st.relaxed.gpu.global.f32 [%0],%1;" ::"l"(p), "f"(v) : "memory");
}

/// The value at p once it is there. After an abort: whatever is there.
template <class T>
__device__ T await_slowly(const T* p, int* control, std::uint64_t patience) {
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
__device__ inline T await(const T* p, int* control, std::uint64_t patience) {
  const T v = load_shared_value(p);
  return is_missing(v) ? await_slowly(p, control, patience) : v;
}

template <class T>
__device__ inline PairOf<T> stream_pair(const T* p) {
  return __ldcs(reinterpret_cast<const PairOf<T>*>(p));
}

template <class T, int Columns>
struct SolveBench {
  T v[kRowBlock * Columns];  ///< the block's part of the vector
  T x[kRowBlock * Columns];  ///< finished values of the block
  unsigned char active[kThreads];
  int next;
  Front front;
};

__device__ inline int lane_of_thread() { return static_cast<int>(threadIdx.x) & 31; }
__device__ inline int warp_of_thread() { return static_cast<int>(threadIdx.x) >> 5; }

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

// ---- up ------------------------------------------------------------------------------------------------------------

/// v += the children's updates that fall into tile rows [tile, tile_end); row0: padded row of v[0].
template <class T, int C>
__device__ void gather_updates(const SolveState<T>& s, SolveBench<T, C>& b, int tile, int tile_end, int row0) {
  const Front& f = b.front;
  const int gap = f.pivot_pad - f.pivots;
  for (int base = f.link_begin; base < f.link_end; base += kThreads) {
    const int count = min(kThreads, f.link_end - base);
    if (static_cast<int>(threadIdx.x) < count) {
      const std::int32_t* bound = s.bounds + s.links[base + threadIdx.x].bound;
      b.active[threadIdx.x] = static_cast<unsigned char>(bound[tile] < bound[tile_end]);
    }
    __syncthreads();
    for (int k = 0; k < count; ++k) {
      if (b.active[k] == 0) continue;
      const Link link = s.links[base + k];
      const int r0 = s.bounds[link.bound + tile], r1 = s.bounds[link.bound + tile_end];
      const std::int64_t first = s.fronts[link.child].rows;
      for (int y = r0 * C + static_cast<int>(threadIdx.x); y < r1 * C; y += kThreads) {
        const int to = s.relative[first + y / C];
        const T u = await(s.updates + first * C + y, s.control, s.patience);
        b.v[(to + (to >= f.pivots ? gap : 0) - row0) * C + y % C] += u;
      }
      __syncthreads();
    }
  }
}

/// v -= L(rows of the block, columns before it) times the finished part of the forward solution.
template <class T, int C>
__device__ void subtract_left(const SolveState<T>& s, SolveBench<T, C>& b, const T* factor, int row, int rows,
                              int chunks) {
  const Front& f = b.front;
  const int lane = lane_of_thread(), g = lane >> 2, t = lane & 3, top = warp_of_thread() * 32;
  if (top >= rows || chunks == 0) return;
  constexpr int kBatch = C == 1 ? 2 : 1;
  T acc[4][C] = {};
  for (int q0 = 0; q0 < chunks; q0 += kBatch) {
    PairOf<T> l[kBatch][4][2];
#pragma unroll
    for (int q = 0; q < kBatch; ++q) {
      const T* from = factor + f.chunk_offset(min(q0 + q, chunks - 1), row) + top * kChunk + lane * 2;
#pragma unroll
      for (int p = 0; p < 4; ++p)
#pragma unroll
        for (int h = 0; h < 2; ++h)
          if (top + 8 * p < rows) l[q][p][h] = stream_pair(from + p * 128 + h * 64);
    }
#pragma unroll
    for (int q = 0; q < kBatch; ++q)
#pragma unroll
      for (int u = 0; u < 4; ++u) {
        const int col = (q0 + q) * kChunk + 4 * u + t;
        const bool real = q0 + q < chunks && col < f.pivots;
#pragma unroll
        for (int c = 0; c < C; ++c) {
          const T y =
              real ? await(s.forward + static_cast<std::int64_t>(f.position + col) * C + c, s.control, s.patience)
                   : T(0);
#pragma unroll
          for (int p = 0; p < 4; ++p)
            if (top + 8 * p < rows) acc[p][c] += ((u & 1) != 0 ? l[q][p][u >> 1].y : l[q][p][u >> 1].x) * y;
        }
      }
  }
#pragma unroll
  for (int p = 0; p < 4; ++p)
#pragma unroll
    for (int c = 0; c < C; ++c) {
      const T sum = sum_over_columns(acc[p][c]);
      if (t == 0 && top + 8 * p < rows) b.v[(top + 8 * p + g) * C + c] -= sum;
    }
}

/// out(rows) = beta out + alpha A in for `rows` x `cols` panels at `a` (chunks `stride` apart); in, out in shared
/// memory.
template <class T, int C>
__device__ void multiply_panels(const T* a, std::int64_t stride, int rows, int cols, const T* in, T* out,
                                bool subtract) {
  const int lane = lane_of_thread(), g = lane >> 2, t = lane & 3;
  for (int p = warp_of_thread(); p < rows / 8; p += 4) {
    T acc[C] = {};
    for (int q = 0; q < cols / kChunk; ++q) {
      const T* from = a + q * stride + p * 128 + lane * 2;
      const auto lo = load_pair(from), hi = load_pair(from + 64);
      const T* y = in + (q * kChunk + t) * C;
#pragma unroll
      for (int c = 0; c < C; ++c)
        acc[c] += lo.x * y[c] + lo.y * y[4 * C + c] + hi.x * y[8 * C + c] + hi.y * y[12 * C + c];
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
  for (int y = threadIdx.x; y < count * C; y += kThreads) publish(to + y, from[y]);
}

/// One row block of a front; block < 0: a front of one block in all.
template <class T, int C>
__device__ void go_up(const SolveState<T>& s, SolveBench<T, C>& b, int block, int first_column) {
  const Front& f = b.front;
  const bool all = block < 0;
  const int a = all ? 0 : block;
  const bool pivot = a < f.pivot_blocks;
  const int row = f.block_begin(a), end = all ? f.total_pad : f.block_end(a), rows = end - row;
  const int per_block = kRowBlock / f.width;
  const int tile = pivot ? a * per_block : f.pivot_tiles + (a - f.pivot_blocks) * per_block;
  const int tile_end = all ? f.tiles : min(tile + per_block, pivot ? f.pivot_tiles : f.tiles);
  const T* factor = s.arena + (s.up_second ? f.second : f.factor);
  for (int y = threadIdx.x; y < kRowBlock * C; y += kThreads) {
    const int r = row + y / C, c = first_column + y % C;
    b.v[y] = pivot && r < f.pivots && c < s.columns ? s.rhs[static_cast<std::int64_t>(f.position + r) * s.columns + c]
                                                    : T(0);
  }
  __syncthreads();
  gather_updates(s, b, tile, tile_end, row);
  subtract_left(s, b, factor, row, rows, (pivot ? row : f.pivot_pad) / kChunk);
  __syncthreads();
  const int tiles_here = pivot ? (all ? f.pivot_tiles : tile_end) : tile;
  for (int j = tile; j < tiles_here; ++j) {
    const int col = f.column_begin(j), last = f.column_end(j), size = last - col, q = col / kChunk;
    const std::int64_t stride = static_cast<std::int64_t>(f.total_pad - j * f.width) * kChunk;
    multiply_panels<T, C>(factor + f.chunk_offset(q, col), stride, size, size, b.v + (col - row) * C, b.x, false);
    __syncthreads();
    publish_rows<T, C>(b.x, s.forward + static_cast<std::int64_t>(f.position + col) * C, min(size, f.pivots - col));
    if (last < end)
      multiply_panels<T, C>(factor + f.chunk_offset(q, last), stride, end - last, size, b.x, b.v + (last - row) * C,
                            true);
    __syncthreads();
  }
  if (all)
    publish_rows<T, C>(b.v + f.pivot_pad * C, s.updates + f.rows * C, f.below);
  else if (!pivot)
    publish_rows<T, C>(b.v, s.updates + (f.rows + row - f.pivot_pad) * C, min(rows, f.below - (row - f.pivot_pad)));
}

// ---- down ----------------------------------------------------------------------------------------------------------

/// acc[u] += sum over the rows of `Panels` panels of A(row, 4 u + t) x(row); value(p, c): x of this lane's row of panel
/// p.
template <class T, int C, int Panels>
__device__ inline void add_transposed(T (&acc)[4][C], const PairOf<T> (&l)[Panels][2], const T (&x)[Panels][C]) {
#pragma unroll
  for (int p = 0; p < Panels; ++p)
#pragma unroll
    for (int c = 0; c < C; ++c) {
      acc[0][c] += l[p][0].x * x[p][c];
      acc[1][c] += l[p][0].y * x[p][c];
      acc[2][c] += l[p][1].x * x[p][c];
      acc[3][c] += l[p][1].y * x[p][c];
    }
}

/// x of padded row r of the front; zero for padding.
template <class T, int C>
__device__ inline void await_row(const SolveState<T>& s, const Front& f, int r, T (&x)[C]) {
  int position = -1;
  if (r < f.pivot_pad) {
    if (r < f.pivots) position = f.position + r;
  } else if (r - f.pivot_pad < f.below) {
    position = s.rows[f.rows + r - f.pivot_pad];
  }
#pragma unroll
  for (int c = 0; c < C; ++c)
    x[c] = position < 0 ? T(0) : await(s.solution + static_cast<std::int64_t>(position) * C + c, s.control, s.patience);
}

/// v -= L(rows from `from` on, columns of the block)^T x, from the last row up: what is known first comes first.
template <class T, int C>
__device__ void subtract_below(const SolveState<T>& s, SolveBench<T, C>& b, const T* factor, int col, int cols,
                               int from) {
  const Front& f = b.front;
  const int lane = lane_of_thread(), g = lane >> 2, t = lane & 3;
  constexpr int kAtOnce = C == 1 ? 2 : 1;  // chunks of this warp in one sweep
  constexpr int kPanels = C == 1 ? 4 : 2;
  const int panels = (f.total_pad - from) / 8;
  if (panels == 0) return;
  for (int q0 = warp_of_thread(); q0 < cols / kChunk; q0 += 4 * kAtOnce) {
    T acc[kAtOnce][4][C] = {};
    const T* base[kAtOnce];
    bool wanted[kAtOnce];
#pragma unroll
    for (int k = 0; k < kAtOnce; ++k) {
      wanted[k] = q0 + 4 * k < cols / kChunk;
      base[k] = factor + f.chunk_offset(col / kChunk + (wanted[k] ? q0 + 4 * k : q0), from) + lane * 2;
    }
    for (int top = panels; top > 0; top -= kPanels) {
      PairOf<T> l[kAtOnce][kPanels][2];
      T x[kPanels][C];
#pragma unroll
      for (int k = 0; k < kAtOnce; ++k)
#pragma unroll
        for (int p = 0; p < kPanels; ++p)
#pragma unroll
          for (int h = 0; h < 2; ++h)
            if (wanted[k])
              l[k][p][h] = stream_pair(base[k] + static_cast<std::int64_t>(max(top - 1 - p, 0)) * 128 + h * 64);
#pragma unroll
      for (int p = 0; p < kPanels; ++p) {
        if (top - 1 - p >= 0) {
          await_row<T, C>(s, f, from + (top - 1 - p) * 8 + g, x[p]);
        } else {
#pragma unroll
          for (int c = 0; c < C; ++c) x[p][c] = T(0);
        }
      }
#pragma unroll
      for (int k = 0; k < kAtOnce; ++k)
        if (wanted[k]) add_transposed<T, C, kPanels>(acc[k], l[k], x);
    }
#pragma unroll
    for (int k = 0; k < kAtOnce; ++k)
#pragma unroll
      for (int u = 0; u < 4; ++u)
#pragma unroll
        for (int c = 0; c < C; ++c) {
          const T sum = sum_over_rows(acc[k][u][c]);
          if (wanted[k] && g == 0) b.v[((q0 + 4 * k) * kChunk + 4 * u + t) * C + c] -= sum;
        }
  }
}

/// out(cols) = beta out + alpha A^T in for `rows` x `cols` panels at `a`; in, out in shared memory.
template <class T, int C>
__device__ void multiply_panels_transposed(const T* a, std::int64_t stride, int rows, int cols, const T* in, T* out,
                                           bool subtract) {
  const int lane = lane_of_thread(), g = lane >> 2, t = lane & 3;
  for (int q = warp_of_thread(); q < cols / kChunk; q += 4) {
    T acc[4][C] = {};
    for (int p = 0; p < rows / 8; ++p) {
      PairOf<T> l[1][2];
      T x[1][C];
      const T* from = a + q * stride + p * 128 + lane * 2;
      l[0][0] = load_pair(from);
      l[0][1] = load_pair(from + 64);
#pragma unroll
      for (int c = 0; c < C; ++c) x[0][c] = in[(8 * p + g) * C + c];
      add_transposed<T, C, 1>(acc, l, x);
    }
#pragma unroll
    for (int u = 0; u < 4; ++u)
#pragma unroll
      for (int c = 0; c < C; ++c) {
        const T sum = sum_over_rows(acc[u][c]);
        T* to = out + (q * kChunk + 4 * u + t) * C + c;
        if (g == 0) *to = subtract ? *to - sum : sum;
      }
  }
}

/// v = the forward solution of the block, times D^-1 for ldlt; zero in the padding.
template <class T, int C>
__device__ void take_forward(const SolveState<T>& s, SolveBench<T, C>& b, int col, int cols) {
  const Front& f = b.front;
  for (int y = threadIdx.x; y < kRowBlock * C; y += kThreads) {
    const bool real = y / C < cols && col + y / C < f.pivots;
    const std::int64_t at = static_cast<std::int64_t>(f.position + col) * C + y;
    const T v = real ? await(s.forward + at, s.control, s.patience) : T(0);
    (s.inverse_d != nullptr ? b.x : b.v)[y] = v;
  }
  if (s.inverse_d == nullptr) return;
  __syncthreads();
  for (int y = threadIdx.x; y < kRowBlock * C; y += kThreads) {
    const int k = y / C, position = f.position + col + k;
    T v = T(0);
    if (k < cols && col + k < f.pivots) {
      v = s.inverse_d[position] * b.x[y];
      const T e = s.inverse_e[position];
      if (e != T(0)) v += e * b.x[y + C];
      const T before = col + k > 0 ? s.inverse_e[position - 1] : T(0);
      if (before != T(0) && k > 0) v += before * b.x[y - C];
    }
    b.v[y] = v;
  }
}

/// One row block of pivots.
template <class T, int C>
__device__ void go_down(const SolveState<T>& s, SolveBench<T, C>& b, int a, int first_column) {
  const Front& f = b.front;
  const int col = f.block_begin(a), end = f.block_end(a), cols = end - col;
  const int per_block = kRowBlock / f.width, tile = a * per_block;
  const T* factor = s.arena + (s.down_second ? f.second : f.factor);
  take_forward(s, b, col, cols);
  __syncthreads();
  subtract_below(s, b, factor, col, cols, end);
  __syncthreads();
  for (int j = min(tile + per_block, f.pivot_tiles) - 1; j >= tile; --j) {
    const int c0 = f.column_begin(j), c1 = f.column_end(j), size = c1 - c0, q = c0 / kChunk;
    const std::int64_t stride = static_cast<std::int64_t>(f.total_pad - j * f.width) * kChunk;
    if (c1 < end) {
      multiply_panels_transposed<T, C>(factor + f.chunk_offset(q, c1), stride, end - c1, size, b.x + (c1 - col) * C,
                                       b.v + (c0 - col) * C, true);
      __syncthreads();
    }
    multiply_panels_transposed<T, C>(factor + f.chunk_offset(q, c0), stride, size, size, b.v + (c0 - col) * C,
                                     b.x + (c0 - col) * C, false);
    __syncthreads();
    const int real = min(size, f.pivots - c0);
    publish_rows<T, C>(b.x + (c0 - col) * C, s.solution + static_cast<std::int64_t>(f.position + c0) * C, real);
    for (int y = threadIdx.x; y < real * C; y += kThreads)
      if (first_column + y % C < s.columns)
        s.rhs[static_cast<std::int64_t>(f.position + c0 + y / C) * s.columns + first_column + y % C] =
            b.x[(c0 - col) * C + y];
  }
}

template <class T, int C>
__global__ void __launch_bounds__(kThreads, C == 1 ? 4 : 2)
    solve_kernel(const __grid_constant__ SolveState<T> s, int first_column) {
  __shared__ SolveBench<T, C> b;
  for (;;) {
    __syncthreads();
    if (threadIdx.x == 0)
      b.next = load_relaxed(s.control + 1) != 0 ? s.up_tasks + s.down_tasks : atomicAdd(s.control, 1);
    __syncthreads();
    const int id = b.next;
    if (id >= s.up_tasks + s.down_tasks) return;
    const SolveTask task = id < s.up_tasks ? s.up[id] : s.down[id - s.up_tasks];
    const int* from = reinterpret_cast<const int*>(s.fronts + task.front);
    for (int x = threadIdx.x; x < static_cast<int>(sizeof(Front) / sizeof(int)); x += kThreads)
      reinterpret_cast<int*>(&b.front)[x] = from[x];
    __syncthreads();
    if (id < s.up_tasks)
      go_up(s, b, task.block, first_column);
    else
      go_down(s, b, task.block, first_column);
  }
}

}  // namespace

template <class T>
cudaError_t SolveKernel<T>::resident(bool many, int& blocks) {
  int device = 0, multiprocessors = 0, each = 0;
  if (const auto e = cudaGetDevice(&device)) return e;
  if (const auto e = cudaDeviceGetAttribute(&multiprocessors, cudaDevAttrMultiProcessorCount, device)) return e;
  const auto e = many ? cudaOccupancyMaxActiveBlocksPerMultiprocessor(&each, solve_kernel<T, kManyColumns>, kThreads, 0)
                      : cudaOccupancyMaxActiveBlocksPerMultiprocessor(&each, solve_kernel<T, 1>, kThreads, 0);
  blocks = each * multiprocessors;
  return e;
}

template <class T>
cudaError_t SolveKernel<T>::launch(bool many, int blocks, const SolveState<T>& state, int first_column,
                                   cudaStream_t stream) {
  const int grid = std::min(blocks, state.up_tasks + state.down_tasks);
  if (many)
    solve_kernel<T, kManyColumns><<<grid, kThreads, 0, stream>>>(state, first_column);
  else
    solve_kernel<T, 1><<<grid, kThreads, 0, stream>>>(state, first_column);
  return cudaGetLastError();
}

}  // namespace espalier::device::cuda

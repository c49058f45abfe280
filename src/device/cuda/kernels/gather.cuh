/// \file
/// What the tasks of the factorization have in common: gathering, the arrays of a front, checks of L.
#pragma once

#include "device/cuda/kernels/place.cuh"
#include "device/cuda/kernels/task_feed.cuh"

namespace espalier::device::cuda {

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
  x.tile_col_end = task.work == Work::two_columns ? j + 2 : j + 1;
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
  zero_area(area, x.ld * (task.work == Work::whole ? f.total_pad : f.width * (x.tile_col_end - x.tile_col)));
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
  fence_shared();
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

}  // namespace espalier::device::cuda

/// \file
/// Tiles that are made step by step, in their places: between scratch in shared memory and the front's arrays.
#pragma once

#include "device/cuda/tables/tables.hpp"

namespace espalier::device::cuda {

/// Where the tile of a task stands, and its size.
template <class T>
struct TilePlace {
  T* to;
  bool pivot;
  std::int64_t stride;  ///< pivots: from chunk to chunk; below: leading dimension
  int rows, cols;       ///< below: without the padding
};

/// @param row, rows  padded rows of the task's tile in tile column task.column
template <class T>
__device__ inline TilePlace<T> place_of_tile(T* base, const Front& f, const FactorTask& task, int row, int rows) {
  const int j = task.column, col = f.column_begin(j), cols = f.column_end(j) - col;
  if (j < f.pivot_tiles)
    return {base + ((task.part == 0 ? f.factor : f.second) + f.chunk_offset(col / kChunk, row)), true,
            static_cast<std::int64_t>(f.total_pad - j * f.width) * kChunk, rows, cols};
  const int r0 = row - f.pivot_pad, c0 = col - f.pivot_pad;
  return {base + ((task.part == 0 ? f.contribution : f.contribution_up) + f.contribution_offset(c0, c0) + (r0 - c0)),
          false, f.below_ld - c0, min(rows, f.below - r0), min(cols, f.below - c0)};
}

/// use(element in place, row, column) for every element; by all threads, neighbours together.
template <class T, class Use>
__device__ inline void for_each_in_place(const TilePlace<T>& p, Use&& use) {
  if (!p.pivot) {
    const int warp = static_cast<int>(threadIdx.x) >> 5, lane = static_cast<int>(threadIdx.x) & 31;
    for (int c = warp; c < p.cols; c += kThreads / 32)
      for (int r = lane; r < p.rows; r += 32) use(p.to + c * p.stride + r, r, c);
    return;
  }
  const int per_chunk = p.rows * kChunk;
  for (int x = threadIdx.x; x < p.rows * p.cols; x += kThreads) {
    const int q = x / per_chunk, rest = x % per_chunk, inner = rest % 128;
    const int r = rest / 128 * kPanel + (inner % 64 >> 3);
    const int c = q * kChunk + (inner >> 6) * 8 + (inner >> 1 & 3) + 4 * (inner & 1);
    use(p.to + q * p.stride + rest, r, c);
  }
}

/// place += tile; column-major scratch.
template <class T>
__device__ inline void add_to_place(const TilePlace<T>& p, const T* tile, int ld) {
  for_each_in_place(p, [&](T* to, int r, int c) { *to += tile[c * ld + r]; });
}

template <class T>
__device__ inline void take_from_place(const TilePlace<T>& p, T* tile, int ld) {
  for_each_in_place(p, [&](T* from, int r, int c) { tile[c * ld + r] = *from; });
}

}  // namespace espalier::device::cuda

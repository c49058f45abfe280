/// \file
/// Gathering: the entries of A and the children's contributions that belong to a piece of a front, into a column-major
/// tile in shared memory. Every element is summed in a fixed order: entries, then children as listed.
#pragma once

#include "device/cuda/factor_state.cuh"

namespace espalier::device::cuda {

/// A rectangle of a front: tile rows tile_row .. tile_row_end - 1, tile columns likewise. Front row r (not padded) goes
/// to row r - row0 + (r >= pivots ? gap : 0), columns likewise with col0.
template <class T>
struct Target {
  T* to;  ///< shared memory, zeroed
  int ld;
  int tile_row, tile_row_end;
  int tile_col, tile_col_end;
  int row0, col0;
  int gap;      ///< padding between pivots and rows below where the rectangle spans both; else 0
  int part;     ///< 0: lower part; 1: transposed upper part (lu)
  bool square;  ///< lu, rectangle on the diagonal: the upper part is added transposed
};

/// Scratch in shared memory for assemble().
struct AssembleScratch {
  unsigned char active[kThreads];
};

/// First front row (not padded) of tile row i.
__device__ inline int tile_begin(const Front& f, int i) {
  if (i < f.pivot_tiles) return i * f.width;
  const int r = f.pivots + (i - f.pivot_tiles) * f.width;
  return r < f.pivots + f.below ? r : f.pivots + f.below;
}

template <class T>
__device__ void add_entries(const FactorState<T>& s, const Front& f, const Target<T>& x) {
  constexpr std::uint64_t kPlace = ((1u << 22) - 1) << 1;  // row and column bits of an entry
  for (int j = x.tile_col; j < x.tile_col_end; ++j)
    for (int i = f.whole ? j : (x.tile_row > j ? x.tile_row : j); i < x.tile_row_end; ++i) {
      if (f.whole && (i > 0 || j > 0)) continue;  // all entries of a whole front stand at its first tile
      const std::int64_t tile =
          f.tile0 + static_cast<std::int64_t>(j) * f.tiles - static_cast<std::int64_t>(j) * (j - 1) / 2 + (i - j);
      const std::int64_t begin = s.entry_ptr[tile], end = s.entry_ptr[tile + 1];
      const int dr = f.whole ? 0 : tile_begin(f, i) - x.row0, dc = f.whole ? 0 : tile_begin(f, j) - x.col0;
      for (std::int64_t q = begin + threadIdx.x; q < end; q += kThreads) {
        const std::uint64_t first = s.entries[q];
        if (q > begin && ((s.entries[q - 1] ^ first) & kPlace) == 0) continue;  // its run has an owner
        std::uint64_t e = first;
        for (std::int64_t p = q;;) {
          int r = static_cast<int>(e >> 12 & 2047), c = static_cast<int>(e >> 1 & 2047);
          const int up = static_cast<int>(e & 1);
          r += dr + (f.whole && r >= f.pivots ? x.gap : 0);
          c += dc + (f.whole && c >= f.pivots ? x.gap : 0);
          const T v = s.values[e >> 23];
          if (x.square && up)
            x.to[r * x.ld + c] += v;
          else if (x.square || up == x.part)
            x.to[c * x.ld + r] += v;
          if (++p == end) break;
          e = s.entries[p];
          if (((e ^ first) & kPlace) != 0) break;
        }
      }
    }
}

/// Adds the rows [r0, r1) and columns [c0, c1) of a child's contribution (0-based among its rows below, only r >= c, or
/// r > c for the strict part). A warp owns the target columns with its number modulo four.
template <class T>
__device__ void add_child(const FactorState<T>& s, const Front& f, const Front& child, const Target<T>& x, int r0,
                          int r1, int c0, int c1, const T* from, bool transposed, bool strict) {
  const std::int32_t* map = s.relative + child.rows;
  const int warp = static_cast<int>(threadIdx.x) >> 5, lane = static_cast<int>(threadIdx.x) & 31;
  for (int rb = r0; rb < r1; rb += 128) {
    int row[4];
#pragma unroll
    for (int u = 0; u < 4; ++u) {
      const int r = rb + lane + 32 * u;
      row[u] = -1;
      if (r < r1) {
        const int to = map[r];
        row[u] = to - x.row0 + (to >= f.pivots ? x.gap : 0);
      }
    }
    for (int cb = c0; cb < c1; cb += 32) {
      int col = 0;
      bool mine = false;
      if (cb + lane < c1) {
        const int to = map[cb + lane];
        col = to - x.col0 + (to >= f.pivots ? x.gap : 0);
        mine = (col & 3) == warp;
      }
      unsigned mask = __ballot_sync(0xffffffffu, mine);
      while (mask != 0) {
        int place[4];
        T v[4][4];
#pragma unroll
        for (int k = 0; k < 4; ++k) {
          const int bit = mask != 0 ? __ffs(static_cast<int>(mask)) - 1 : 0;
          place[k] = mask != 0 ? __shfl_sync(0xffffffffu, col, bit) : -1;
          const int c = cb + bit;
          const T* column = from + child.contribution_offset(c / child.width * child.width, c);
          const int first = c / child.width * child.width;
#pragma unroll
          for (int u = 0; u < 4; ++u) {
            const int r = rb + lane + 32 * u;
            const bool wanted = place[k] >= 0 && r < r1 && (strict ? r > c : r >= c);
            v[k][u] = wanted ? column[r - first] : T(0);
          }
          mask &= mask - 1;
        }
#pragma unroll
        for (int k = 0; k < 4; ++k)
          if (place[k] >= 0) {
#pragma unroll
            for (int u = 0; u < 4; ++u)
              if (row[u] >= 0) {
                T* to = transposed ? x.to + row[u] * x.ld + place[k] : x.to + place[k] * x.ld + row[u];
                // Where the rectangle holds only the lower triangle, what would fall above the diagonal was read as
                // zero.
                if (v[k][u] != T(0)) *to += v[k][u];
              }
          }
      }
    }
  }
  __syncwarp();
}

/// Waits until the child's contribution blocks that cover these rows and columns are finished.
template <class T>
__device__ void wait_for_child(const FactorState<T>& s, const Front& child, int r0, int r1, int c0, int c1, int part) {
  const int b0 = c0 / child.width, b1 = (c1 - 1) / child.width;
  const int a0 = r0 / kRowBlock, a1 = (r1 - 1) / kRowBlock;
  const int columns = b1 - b0 + 1;
  const int count = columns * (a1 - a0 + 1);
  for (int x = threadIdx.x; x < count; x += kThreads) {
    const int b = b0 + x % columns, a = a0 + x / columns;
    if ((a + 1) * kRowBlock <= b * child.width) continue;  // above the diagonal: no such task
    const std::int64_t flag = child.flag(child.pivot_blocks + a, child.pivot_tiles + b);
    wait_for(s.flags(part) + flag, 1, s.control, s.patience);
  }
}

/// Fills the target (already zero) from A and the children. @pre all threads have passed a barrier after the zeroing
template <class T, bool Lu>
__device__ void assemble(const FactorState<T>& s, const Front& f, const Target<T>& x, AssembleScratch& scratch) {
  add_entries(s, f, x);
  __syncthreads();
  for (int base = f.link_begin; base < f.link_end; base += kThreads) {
    const int count = min(kThreads, f.link_end - base);
    if (static_cast<int>(threadIdx.x) < count) {
      const Link link = s.links[base + threadIdx.x];
      const std::int32_t* b = s.bounds + link.bound;
      scratch.active[threadIdx.x] = static_cast<unsigned char>(max(b[x.tile_row], b[x.tile_col]) < b[x.tile_row_end] &&
                                                               b[x.tile_col] < b[x.tile_col_end]);
    }
    __syncthreads();
    const auto for_each_active = [&](auto&& use) {
      for (int k = 0; k < count; ++k) {
        if (scratch.active[k] == 0) continue;
        const Link link = s.links[base + k];
        const std::int32_t* b = s.bounds + link.bound;
        const int c0 = b[x.tile_col];
        use(s.fronts[link.child], max(b[x.tile_row], c0), b[x.tile_row_end], c0, b[x.tile_col_end]);
      }
    };
    for_each_active([&](const Front& child, int r0, int r1, int c0, int c1) {
      if (x.part == 0 || x.square) wait_for_child(s, child, r0, r1, c0, c1, 0);
      if (Lu && (x.part == 1 || x.square)) wait_for_child(s, child, r0, r1, c0, c1, 1);
    });
    __syncthreads();
    for_each_active([&](const Front& child, int r0, int r1, int c0, int c1) {
      if (!Lu || x.square || x.part == 0)
        add_child(s, f, child, x, r0, r1, c0, c1, s.arena + child.contribution, false, false);
      if (Lu && (x.square || x.part == 1))
        add_child(s, f, child, x, r0, r1, c0, c1, s.arena + child.contribution_up, x.square, true);
    });
    __syncthreads();
  }
}

}  // namespace espalier::device::cuda

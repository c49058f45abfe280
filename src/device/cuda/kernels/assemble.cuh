/// \file
/// Gathering: the entries of A and the children's contributions that belong to a part of a front, into a column-major
/// tile in shared memory. Every element is summed in a fixed order: entries, then children as listed.
#pragma once

#include "device/cuda/kernels/factor/factor_state.cuh"

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

/// First front row (not padded) of tile row i.
__device__ inline int tile_begin(const Front& f, int i) {
  if (i < f.pivot_tiles) return i * f.width;
  const int r = f.pivots + (i - f.pivot_tiles) * f.width;
  return r < f.pivots + f.below ? r : f.pivots + f.below;
}

template <class T>
__device__ void add_entries_of_tile(const FactorState<T>& s, const Front& f, const Target<T>& x, int i, int j) {
  constexpr std::uint64_t kPlace = ((1u << 22) - 1) << 1;  // row and column bits of an entry
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

/// Rows [r0, r1) and columns [c0, c1) of a child's contribution (0-based among its rows below).
struct Overlap {
  int child;
  int r0, r1, c0, c1;
};

/// Where a child's contribution stands.
template <class T>
struct Source {
  const T* lower;
  const T* upper;     ///< lu
  std::int64_t rows;  ///< place of its first row below in FactorState::relative
  int shift;          ///< log2 of the width of its tile columns
  int ld;             ///< Front::below_ld
  int placed;         ///< 1: it is not contiguous, see Front::place()
};

/// use(overlap, number, source) for every child that has a part in the target, in order; every warp finds the same.
/// Sources are looked up only where wanted, for up to 32 children at a time, so that their way through memory is waited
/// for once and not by every child.
template <bool Sources, class T, class Use>
__device__ inline void for_each_overlap(const FactorState<T>& s, const Front& f, const Target<T>& x, Use&& use) {
  const int lane = static_cast<int>(threadIdx.x) & 31;
  for (int base = f.link_begin; base < f.link_end; base += 32) {
    Overlap mine{};
    Source<T> source{};
    if (base + lane < f.link_end) {
      const ChildRows link = s.links[base + lane];
      const std::int32_t* b = s.bounds + link.bound;
      mine.child = link.child;
      mine.c0 = b[x.tile_col];
      mine.c1 = b[x.tile_col_end];
      mine.r0 = max(b[x.tile_row], mine.c0);
      mine.r1 = b[x.tile_row_end];
      if (Sources && mine.r0 < mine.r1 && mine.c0 < mine.c1) {
        const Front& child = s.fronts[link.child];
        const T* base = s.base[child.region];
        source = {base + child.contribution, base + child.contribution_up, child.rows, child.width_log2, child.below_ld,
                  child.first_place >= 0};
      }
    }
    unsigned mask = __ballot_sync(0xffffffffu, mine.r0 < mine.r1 && mine.c0 < mine.c1);
    for (; mask != 0; mask &= mask - 1) {
      const int k = __ffs(static_cast<int>(mask)) - 1;
      Overlap p;
      p.child = __shfl_sync(0xffffffffu, mine.child, k);
      p.r0 = __shfl_sync(0xffffffffu, mine.r0, k);
      p.r1 = __shfl_sync(0xffffffffu, mine.r1, k);
      p.c0 = __shfl_sync(0xffffffffu, mine.c0, k);
      p.c1 = __shfl_sync(0xffffffffu, mine.c1, k);
      Source<T> from{};
      if constexpr (Sources) {
        const auto pointer = [&](const T* of) {
          return reinterpret_cast<const T*>(__shfl_sync(0xffffffffu, reinterpret_cast<unsigned long long>(of), k));
        };
        from = {pointer(source.lower),
                pointer(source.upper),
                __shfl_sync(0xffffffffu, source.rows, k),
                __shfl_sync(0xffffffffu, source.shift, k),
                __shfl_sync(0xffffffffu, source.ld, k),
                __shfl_sync(0xffffffffu, source.placed, k)};
      }
      use(p, k, from);
    }
  }
}

/// Adds an overlap of the array `from` (only r >= c, or r > c for the strict part). A warp owns the target columns with
/// its number modulo four (target rows where transposed). places: where the tile columns of the array begin, if it is
/// not contiguous; else null.
template <class T>
__device__ void add_overlap(const FactorState<T>& s, const Front& f, const Target<T>& x, const Overlap& overlap,
                            const Source<T>& source, const T* from, T* const* places, bool transposed, bool strict) {
  const std::int32_t* map = s.relative + source.rows;
  const int shift = source.shift, child_ld = source.ld;
  const int warp = static_cast<int>(threadIdx.x) >> 5, lane = static_cast<int>(threadIdx.x) & 31;
  const int row_step = transposed ? x.ld : 1, col_step = transposed ? 1 : x.ld;
  for (int rb = overlap.r0; rb < overlap.r1; rb += 128) {
    int row[4];
#pragma unroll
    for (int u = 0; u < 4; ++u) {
      const int r = rb + lane + 32 * u;
      const int to = r < overlap.r1 ? map[r] : 0;
      row[u] = (to - x.row0 + (to >= f.pivots ? x.gap : 0)) * row_step;
    }
    for (int cb = overlap.c0; cb < overlap.c1; cb += 32) {
      // Lane k prepares column cb + k: where it goes, and where its element of row 0 would stand.
      int col = 0;
      const T* column = from;
      bool mine = false;
      const int c = cb + lane;
      if (c < overlap.c1) {
        const int to = map[c];
        col = to - x.col0 + (to >= f.pivots ? x.gap : 0);
        mine = (col & 3) == warp;
        const int b = c >> shift, first = b << shift;
        if (places != nullptr)
          column = places[b];
        else
          column += static_cast<std::int64_t>(b) * child_ld - (static_cast<std::int64_t>(b) * (b - 1) << shift) / 2
                    << shift;
        column += static_cast<std::int64_t>(c - first) * (child_ld - first) - first;
      }
      for (unsigned mask = __ballot_sync(0xffffffffu, mine); mask != 0;) {
        int place[4], lowest[4];
        T v[4][4];
#pragma unroll
        for (int k = 0; k < 4; ++k) {
          const int bit = mask != 0 ? __ffs(static_cast<int>(mask)) - 1 : 0;
          const bool any = mask != 0;
          place[k] = __shfl_sync(0xffffffffu, col, bit) * col_step;
          lowest[k] = any ? cb + bit + (strict ? 1 : 0) : overlap.r1;
          const T* at =
              reinterpret_cast<const T*>(__shfl_sync(0xffffffffu, reinterpret_cast<unsigned long long>(column), bit));
#pragma unroll
          for (int u = 0; u < 4; ++u) {
            const int r = rb + lane + 32 * u;
            v[k][u] = r < overlap.r1 && r >= lowest[k] ? at[r] : T(0);
          }
          mask &= mask - 1;
        }
#pragma unroll
        for (int k = 0; k < 4; ++k)
#pragma unroll
          for (int u = 0; u < 4; ++u) {
            const int r = rb + lane + 32 * u;
            if (r < overlap.r1 && r >= lowest[k]) x.to[place[k] + row[u]] += v[k][u];
          }
      }
    }
  }
  __syncwarp();
}

template <class T>
__device__ inline void add_overlap(const FactorState<T>& s, const Front& f, const Target<T>& x, const Overlap& overlap,
                                   const T* from, T* const* places, bool transposed, bool strict) {
  const Front& child = s.fronts[overlap.child];
  const Source<T> source{from, from, child.rows, child.width_log2, child.below_ld, 0};
  add_overlap(s, f, x, overlap, source, from, places, transposed, strict);
}

/// Waits until the blocks of the child's contribution that hold the overlap are finished; by one warp. @returns
/// nanoseconds that this lane waited
template <class T>
__device__ unsigned wait_for_overlap(const FactorState<T>& s, const Overlap& overlap, int part) {
  const Front& child = s.fronts[overlap.child];
  const int b0 = overlap.c0 / child.width, columns = (overlap.c1 - 1) / child.width - b0 + 1;
  unsigned waited = 0;
  const int a0 = overlap.r0 / kRowBlock, count = columns * ((overlap.r1 - 1) / kRowBlock - a0 + 1);
  for (int x = static_cast<int>(threadIdx.x) & 31; x < count; x += 32) {
    const int b = b0 + x % columns, a = a0 + x / columns;
    if ((a + 1) * kRowBlock <= b * child.width) continue;  // above the diagonal: no such task
    const std::int64_t flag = child.flag(child.pivot_blocks + a, child.pivot_tiles + b);
    waited += wait_for(s.flags(part) + flag, 1, s.control, s.patience);
  }
  return waited;
}

/// Fills the target (already zero) from A and the children. @pre all threads have passed a barrier after the zeroing
/// @returns nanoseconds that this thread waited for children
template <class T, bool Lu>
__device__ inline unsigned assemble(const FactorState<T>& s, const Front& f, const Target<T>& x) {
  unsigned waited = 0;
  const int warp = static_cast<int>(threadIdx.x) >> 5;
  for_each_overlap<false>(s, f, x, [&](const Overlap& overlap, int k, const Source<T>&) {
    if ((k & 3) != warp) return;
    if (!Lu || x.part == 0 || x.square) waited += wait_for_overlap(s, overlap, 0);
    if (Lu && (x.part == 1 || x.square)) waited += wait_for_overlap(s, overlap, 1);
  });
  if (f.whole)
    add_entries_of_tile(s, f, x, 0, 0);  // all entries of a whole front stand at its first tile
  else if (x.tile_col < f.pivot_tiles)
    for (int j = x.tile_col; j < x.tile_col_end; ++j)
      for (int i = x.tile_row; i < x.tile_row_end; ++i) add_entries_of_tile(s, f, x, i, j);
  __syncthreads();
  for_each_overlap<true>(s, f, x, [&](const Overlap& overlap, int, const Source<T>& from) {
    const auto places = [&](int part) -> T* const* {
      return from.placed != 0 ? s.places + s.fronts[overlap.child].place(0, part) : nullptr;
    };
    if (!Lu || x.square || x.part == 0) add_overlap(s, f, x, overlap, from, from.lower, places(0), false, false);
    if (Lu && (x.square || x.part == 1)) add_overlap(s, f, x, overlap, from, from.upper, places(1), x.square, true);
  });
  __syncthreads();
  return waited;
}

}  // namespace espalier::device::cuda

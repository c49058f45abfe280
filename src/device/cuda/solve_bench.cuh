/// \file
/// What a block of the solve kernel works with: values handed from block to block, its part of the vector, sums. For
/// one right-hand side; solve_slabs.cuh has what many need.
#pragma once

#include <type_traits>

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

/// How long a thread has waited for values.
class Wait {
 public:
  /// Whether to go on; false after an abort, which waiting too long is the cause of.
  __device__ bool goes_on(int* control, std::uint64_t patience) {
    if ((++turns_ & 15) != 0) return true;
    const std::uint64_t now = global_nanoseconds();
    if (turns_ == 16) start_ = now;
    if (now - start_ > patience) atomicExch(control + 1, 1);
    return load_relaxed(control + 1) == 0;
  }

 private:
  unsigned turns_ = 0;
  std::uint64_t start_ = 0;
};

/// The value at p once it is there. After an abort: whatever is there.
template <class T>
__device__ __forceinline__ T await(const T* p, int* control, std::uint64_t patience) {
  Wait wait;
  T v = load_shared_value(p);
  while (is_missing(v) && wait.goes_on(control, patience)) v = load_shared_value(p);
  return v;
}

template <class T>
__device__ inline PairOf<T> stream_pair(const T* p) {
  return __ldcs(reinterpret_cast<const PairOf<T>*>(p));
}

constexpr int kLargeThreads = 256;  ///< of a block that takes row blocks: a warp has 16 rows, or 16 columns
constexpr int kSmallThreads = 128;  ///< of a block that takes whole small fronts
constexpr int kSmallPerMultiprocessor = 8;
/// More blocks of the large phase would have to do with fewer registers: elasticity 40 takes 1.9 ms with 2 of them, 2.4
/// with 3, 3.2 with 4.
constexpr int kLargePerMultiprocessor = 2;
__device__ inline int threads() { return static_cast<int>(blockDim.x); }
__device__ inline int warps() { return static_cast<int>(blockDim.x) / 32; }

/// What a block gathers from: children of its front whose updates fall into its rows, 32 at a time.
struct ChildList {
  std::int64_t rows[32];   ///< place of the first row below
  int begin[32], end[32];  ///< their rows that fall into the block
  int count;
};

/// Rows: of the block's part of the vector; more than a row block for whole fronts on the way up, which need no values
/// of other blocks.
template <class T, int Rows>
struct SolveBench {
  T v[Rows];                                  ///< the block's part of the vector
  T x[Rows > kRowBlock ? 1 : 2 * kRowBlock];  ///< finished values of other blocks, two groups in turn; partial sums
  T y[kRowBlock];                             ///< finished values of the block
  T* kept;                                    ///< room for the diagonal part of a block; null: there is none
  std::uint64_t kept_barrier;                 ///< completes when it has come
  ChildList children;
  int next;
  Front front;
};

__device__ inline int lane_of_thread() { return static_cast<int>(threadIdx.x) & 31; }
__device__ inline int warp_of_thread() { return static_cast<int>(threadIdx.x) >> 5; }

/// use(k) for every k < count, by the block's warps in turns: forth and back, so that long and short ones go together.
template <class Use>
__device__ inline void for_each_in_turns(int count, Use&& use) {
  const int each = warps(), warp = warp_of_thread();
#pragma unroll 1
  for (int first = 0, mine = warp; first < count; first += each, mine = each - 1 - mine)
    if (first + mine < count) use(first + mine);
}

/// use(constant N, k) for [first, end) in pieces [k, k + N) of 4, 2 and 1. What a piece loads is defined on every way
/// to its use: registers that are set under a condition stay taken through the whole loop over tasks.
template <class Use>
__device__ inline void for_each_piece(int first, int end, Use&& use) {
#pragma unroll 1
  for (; first + 4 <= end; first += 4) use(std::integral_constant<int, 4>{}, first);
  if (first + 2 <= end) {
    use(std::integral_constant<int, 2>{}, first);
    first += 2;
  }
  if (first < end) use(std::integral_constant<int, 1>{}, first);
}

/// Asks for the lines of [p, p + count) to be brought into the L2 cache; by all threads.
template <class T>
__device__ inline void prefetch(const T* p, int count) {
  constexpr int kLine = 128 / sizeof(T);
#pragma unroll 1
  for (int k = static_cast<int>(threadIdx.x) * kLine; k < count; k += threads() * kLine)
    asm volatile("prefetch.global.L2 [%0];" ::"l"(p + k));
}

/// N chunks of columns of 16 rows of a factor in registers, as a warp's lanes hold them; all chunks of those rows go by
/// one after another.
template <class T, int N>
struct FactorPanels {
  static constexpr int kChunks = N;
  PairOf<T> l[N][2][2] = {};  ///< by chunk, panel, half of a panel; defined from the start: see for_each_piece()

  /// Rows from row + top on of the first `chunks` chunks.
  __device__ FactorPanels(const Front& f, const T* factor, int row, int top, int chunks)
      : at_(factor + (row + top) * kChunk + lane_of_thread() * 2),
        height_(f.total_pad),
        left_(chunks),
        width_(f.width) {}

  /// The next N. Past the end the last one comes again: the values that it meets are zero.
  __device__ void load() {
#pragma unroll
    for (int q = 0; q < N; ++q) {
#pragma unroll
      for (int p = 0; p < 2; ++p)
#pragma unroll
        for (int h = 0; h < 2; ++h) l[q][p][h] = stream_pair(at_ + p * 128 + h * 64);
      if (left_ > 1) advance();
    }
  }

 private:
  // Tile columns become shorter by their width, and so does the way from their first row to `row`.
  __device__ void advance() {
    --left_;
    at_ += static_cast<std::int64_t>(height_) * kChunk;
    column_ += kChunk;
    if (column_ < width_) return;
    column_ = 0;
    at_ -= width_ * kChunk;
    height_ -= width_;
  }

  const T* at_;
  int height_;  // of the tile column
  int left_;    // chunks from here on
  int width_;
  int column_ = 0;  // of the chunk in its tile column
};

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

/// Which of the children's updates fall into tile rows [tile, tile_end), for 32 children from `base` on; by warp 0.
template <class T>
__device__ void find_children(const SolveState<T>& s, const Front& f, ChildList& list, int base, int tile,
                              int tile_end) {
  const int lane = lane_of_thread();
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
    list.begin[at] = r0;
    list.end[at] = r1;
    list.rows[at] = rows;
  }
  if (lane == 0) list.count = __popc(mask);
}

// ---- the diagonal part of a block -----------------------------------------------------------------------------------

/// Tile columns of a block of pivots, each from its diagonal on. Rows and columns count from the block's first pivot.
template <class T>
struct BlockView {
  const T* at;
  int height;  ///< rows of the first tile column
  int width_log2;

  /// First column of the tile column that column c stands in, and the column after its last.
  [[nodiscard]] __device__ int tile_begin(int c) const { return c >> width_log2 << width_log2; }
  [[nodiscard]] __device__ int tile_end(int c) const { return tile_begin(c) + (1 << width_log2); }
  /// Panels of the chunk at column c from row r on; both are multiples of what they count.
  [[nodiscard]] __device__ const T* panels(int c, int r) const {
    const int first = tile_begin(c), before = first >> width_log2;  // tile columns
    const int offset = first * height - (first * (before - 1) / 2 << width_log2) + (c - first) * (height - first) +
                       (r - first) * kChunk;
    return at + offset;
  }
};

/// Most elements of a block's part between its first pivot and its last row: tile columns of 64.
constexpr int kKeptElements = 64 * kRowBlock + 64 * 64;

/// Asks for columns [first, last) of the front, each from its tile's diagonal to row `end`, to be brought into the L2
/// cache: what is used last in a task, and waited for by others. By all threads.
template <class T>
__device__ void prefetch_block(const Front& f, const T* factor, int first, int last, int end) {
#pragma unroll 1
  for (int c = first; c < last; c += kChunk) {
    const int top = c >> f.width_log2 << f.width_log2;
    prefetch(factor + f.chunk_offset(c / kChunk, top), (end - top) * kChunk);
  }
}

/// The same into shared memory, where there is room; `end` is at most 128 rows below `first`. Through the cache, KKT
/// chains of 20 and 2 bodies take 0.50 and 0.26 instead of 0.45 and 0.24 ms (with marks in all tasks).
template <class T, int R>
__device__ void keep_block(SolveBench<T, R>& b, const T* factor, int first, int last, int end) {
  const Front& f = b.front;
  if (!ESPALIER_BULK_COPIES || b.kept == nullptr) {
    prefetch_block(f, factor, first, last, end);
    return;
  }
  if (threadIdx.x != 0) return;
  fence_copies();
  unsigned bytes = 0;
#pragma unroll 1
  for (int c = first; c < last; c += kChunk) bytes += (end - (c >> f.width_log2 << f.width_log2)) * kChunk * sizeof(T);
  barrier_expect(&b.kept_barrier, bytes);
  T* to = b.kept;
#pragma unroll 1
  for (int c = first; c < last; c += kChunk) {
    const int top = c >> f.width_log2 << f.width_log2, count = (end - top) * kChunk;
    bulk_copy(to, factor + f.chunk_offset(c / kChunk, top), count * sizeof(T), &b.kept_barrier);
    to += count;
  }
}

/// Waits until what keep_block() was asked for is there.
template <class T, int R>
__device__ inline void await_kept(SolveBench<T, R>& b, unsigned& parity) {
  if (!ESPALIER_BULK_COPIES || b.kept == nullptr) return;
  barrier_wait(&b.kept_barrier, parity);
  parity ^= 1u;
}

/// The block of pivots from column `first` on, in the factor.
template <class T>
__device__ inline BlockView<T> view_block(const Front& f, const T* factor, int first) {
  return {factor + f.chunk_offset(first / kChunk, first), f.total_pad - first, f.width_log2};
}

/// The same, where keep_block() has put it: to row `end`.
template <class T, int R>
__device__ inline BlockView<T> view_block(const SolveBench<T, R>& b, const T* factor, int first, int end) {
  if (!ESPALIER_BULK_COPIES || b.kept == nullptr) return view_block(b.front, factor, first);
  return {b.kept, end - first, b.front.width_log2};
}

}  // namespace

}  // namespace espalier::device::cuda

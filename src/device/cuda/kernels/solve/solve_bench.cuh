/// \file
/// What a block of the solve kernel works with: values handed from block to block, its part of the vector, sums. For
/// one right-hand side; solve_slabs.cuh has what many need.
#pragma once

#include <type_traits>

#include "device/cuda/kernels/intrinsics.cuh"
#include "device/cuda/kernels/products.cuh"
#include "device/cuda/kernels/solve/solve_kernel.cuh"

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
/// of other blocks. Keeps: there may be room for the diagonal part of a block, after the bench.
template <class T, int Rows, bool Keeps>
struct SolveBench {
  T v[Rows];                                  ///< the block's part of the vector
  T x[Rows > kRowBlock ? 1 : 2 * kRowBlock];  ///< finished values of other blocks, two groups in turn; partial sums
  T y[kRowBlock];                             ///< finished values of the block
  std::uint64_t kept_barrier;                 ///< completes when the diagonal part has come
  int chunk_at[kRowBlock / kChunk];           ///< see BlockView
  bool keeps;                                 ///< there is that room
  ChildList children;
  int next;
  Front front;

  [[nodiscard]] __device__ bool keeps_block() const { return ESPALIER_BULK_COPIES && Keeps && keeps; }
  [[nodiscard]] __device__ T* kept() {
    constexpr int kBytes = (sizeof(SolveBench) + 127) / 128 * 128;
    return reinterpret_cast<T*>(reinterpret_cast<unsigned char*>(this) + kBytes);
  }
};

__device__ inline int lane_of_thread() { return static_cast<int>(threadIdx.x) & 31; }
__device__ inline int warp_of_thread() { return static_cast<int>(threadIdx.x) >> 5; }

/// use(constant N, k) for [first, end) unrolled: steps [k, k + N) of Most, then of 2 and 1. What a step loads is
/// defined on every way to its use: registers that are set under a condition stay taken through the whole loop over
/// tasks.
template <int Most, class Use>
__device__ inline void for_each_unrolled(int first, int end, Use&& use) {
  static_assert(Most == 4 || Most == 2);
#pragma unroll 1
  for (; first + Most <= end; first += Most) use(std::integral_constant<int, Most>{}, first);
  if (Most > 2 && first + 2 <= end) {
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
  PairOf<T> l[N][2][2] = {};  ///< by chunk, panel, half of a panel; defined from the start: see for_each_unrolled()

  /// Rows from row + top on of the first `chunks` chunks.
  __device__ FactorPanels(const Front& f, const T* factor, int row, int top, int chunks)
      : at_(factor + (row + top) * kChunk + lane_of_thread() * 2),
        height_(f.total_pad),
        left_(chunks),
        width_(f.width) {}

  /// The next chunk, into place q. Past the end the last one comes again: the values that it meets are zero.
  __device__ void load(int q) {
#pragma unroll
    for (int p = 0; p < 2; ++p)
#pragma unroll
      for (int h = 0; h < 2; ++h) l[q][p][h] = stream_pair(at_ + p * 128 + h * 64);
    if (left_ > 1) advance();
  }
  __device__ void load_all() {
#pragma unroll
    for (int q = 0; q < N; ++q) load(q);
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

// Sums over lanes of several values at once: lanes that still hold two values pass one on and keep the other, so that
// each ends with one of them. One value after another, by butterflies, is a chain of as many round trips between lanes.

/// Lane d and its partner: keeps a or, for lanes with the bit set, b, and adds what the partner had of it.
template <class T>
__device__ inline T keep_one(T a, T b, int bit) {
  const bool second = (threadIdx.x & bit) != 0;
  const T sent = __shfl_xor_sync(0xffffffffu, second ? a : b, bit);
  return (second ? b : a) + sent;
}
/// Sums of two values over the four lanes t that share a row of a panel: lanes with even t get that of a, others b's.
template <class T>
__device__ inline T sum_over_columns(T a, T b) {
  const T one = keep_one(a, b, 1);
  return one + __shfl_xor_sync(0xffffffffu, one, 2);
}
/// Sums of four values over the eight lanes g that share a column of a panel: lanes g get that of value g % 4.
template <class T>
__device__ inline T sum_over_rows(const T (&x)[4]) {
  const T one = keep_one(keep_one(x[0], x[1], 4), keep_one(x[2], x[3], 4), 8);
  return one + __shfl_xor_sync(0xffffffffu, one, 16);
}

/// Which of the children's updates fall into tile rows [tile, tile_end), for 32 children from `base` on; by warp 0.
template <class T>
__device__ void find_children(const SolveState<T>& s, const Front& f, ChildList& list, int base, int tile,
                              int tile_end) {
  const int lane = lane_of_thread();
  int r0 = 0, r1 = 0;
  std::int64_t rows = 0;
  const ChildRows link = base + lane < f.link_end ? s.links[base + lane] : ChildRows{-1, 0, 0};
  if (link.child >= 0 && (s.marks == nullptr || (s.marks[link.child] & kPathUp) != 0)) {  // else it has left zeros
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
  const int* chunk_at;  ///< place of each chunk's row 0, as if it had one
  int width_log2;
  bool triangular;  ///< inverses of tiles have nothing above their diagonal

  /// The column after the last that row r of an inverse has something in, and the first row of column c; both by 16.
  [[nodiscard]] __device__ int row_end(int r) const {
    return triangular ? (r | (kChunk - 1)) + 1 : ((r >> width_log2) + 1) << width_log2;
  }
  [[nodiscard]] __device__ int column_begin(int c) const { return triangular ? c : c >> width_log2 << width_log2; }
  /// Panels of chunk q from row r on.
  [[nodiscard]] __device__ const T* panels(int q, int r) const { return at + (chunk_at[q] + r * kChunk); }
};

/// Fills BlockView::chunk_at for tile columns of which the first has `height` rows; by the first threads.
__device__ inline void describe_chunks(int height, int width_log2, int* chunk_at) {
  const int c = static_cast<int>(threadIdx.x) * kChunk;
  if (c >= kRowBlock) return;
  const int first = c >> width_log2 << width_log2, before = first >> width_log2;  // tile columns
  chunk_at[threadIdx.x] =
      first * height - (first * (before - 1) / 2 << width_log2) + (c - first) * (height - first) - first * kChunk;
}

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

/// The same into shared memory, where there is room; `end` is at most 128 rows below `first`; also describes its
/// chunks. Through the cache, KKT chains of 20 and 2 bodies take 0.50 and 0.26 instead of 0.45 and 0.24 ms (with marks
/// in all tasks).
template <class T, int R, bool K>
__device__ void keep_block(SolveBench<T, R, K>& b, const T* factor, int first, int last, int end) {
  const Front& f = b.front;
  describe_chunks((b.keeps_block() ? end : f.total_pad) - first, f.width_log2, b.chunk_at);
  if (!b.keeps_block()) {
    prefetch_block(f, factor, first, last, end);
    return;
  }
  if (threadIdx.x != 0) return;
  fence_shared();
  fence_global();
  unsigned bytes = 0;
#pragma unroll 1
  for (int c = first; c < last; c += kChunk) bytes += (end - (c >> f.width_log2 << f.width_log2)) * kChunk * sizeof(T);
  barrier_expect(&b.kept_barrier, bytes);
  T* to = b.kept();
#pragma unroll 1
  for (int c = first; c < last; c += kChunk) {
    const int top = c >> f.width_log2 << f.width_log2, count = (end - top) * kChunk;
    bulk_copy(to, factor + f.chunk_offset(c / kChunk, top), count * sizeof(T), &b.kept_barrier);
    to += count;
  }
}

/// Waits until what keep_block() was asked for is there.
template <class T, int R, bool K>
__device__ inline void await_kept(SolveBench<T, R, K>& b, unsigned& parity) {
  if (!b.keeps_block()) return;
  barrier_wait(&b.kept_barrier, parity);
  parity ^= 1u;
}

/// use(view of the block of pivots from column `first` on): where keep_block() has put it, or in the factor.
template <class T, int R, bool K, class Use>
__device__ inline void with_block(SolveBench<T, R, K>& b, const T* factor, int first, bool triangular, Use&& use) {
  const Front& f = b.front;
  if constexpr (K)
    if (b.keeps_block()) return use(BlockView<T>{b.kept(), b.chunk_at, f.width_log2, triangular});
  use(BlockView<T>{factor + f.chunk_offset(first / kChunk, first), b.chunk_at, f.width_log2, triangular});
}

}  // namespace

}  // namespace espalier::device::cuda

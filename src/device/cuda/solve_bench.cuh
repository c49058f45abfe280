/// \file
/// What a block of the solve kernel works with: values handed from block to block, its part of the vector, sums.
#pragma once

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

}  // namespace

}  // namespace espalier::device::cuda

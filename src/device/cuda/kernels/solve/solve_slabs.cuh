/// \file
/// What a block of the solve kernel works with where there are many right-hand sides.
///
/// A task has C columns of the pass: one or two slabs of eight, whose products tensor cores make. In memory the columns
/// of a pass stand side by side, row by row; in shared memory slab by slab (see place()).
#pragma once

#include "device/cuda/kernels/solve/solve_bench.cuh"

namespace espalier::device::cuda {

namespace {

/// More than three small fronts on a multiprocessor: what they wait for is the memory's latency.
constexpr int kSlabsPerMultiprocessor = 5;

/// Two neighbours; each of them may be missing.
__device__ inline double2 load_shared_pair(const double* p) {
  double2 v;
  asm volatile("ld.relaxed.sys.global.v2.f64 {%0,%1},[%2];" : "=d"(v.x), "=d"(v.y) : "l"(p) : "memory");
  return v;
}
__device__ inline float2 load_shared_pair(const float* p) {
  float2 v;
  asm volatile("ld.relaxed.sys.global.v2.f32 {%0,%1},[%2];" : "=f"(v.x), "=f"(v.y) : "l"(p) : "memory");
  return v;
}
/// Element (row, column c) of a vector of `rows` rows in shared memory.
__device__ inline int place(int row, int c, int rows) { return ((c / kSlab) * rows + row) * kSlab + c % kSlab; }

/// Rows, and a row block more or less: as for SolveBench. Threads: of the block.
template <class T, int C, int Rows, int Threads>
struct SlabBench {
  T v[Rows * C];                                 ///< the block's part of the vector
  T x[Rows > kRowBlock ? 1 : 2 * kRowBlock* C];  ///< finished values of other blocks, two groups in turn; partial sums
  T y[kRowBlock * C];                            ///< finished values of the block
  int chunk_at[kRowBlock / kChunk];              ///< see BlockView
  ChildList children;
  int next;
  int first;  ///< first column of the task in the pass
  Front front;
};

/// Element (row, column c of the task) of a vector of the pass.
template <class T, int C, int R, int W>
__device__ inline std::int64_t element(const SolveState<T>& s, const SlabBench<T, C, R, W>& b, std::int64_t row,
                                       int c) {
  return row * s.pass + (b.first + c);
}

/// 128 rows of a vector on their way to shared memory: located two groups ahead and asked for one group ahead, so that
/// what is there already costs no wait. A thread has a row of them, or two threads share one, two neighbouring columns
/// in turn.
template <class T, int C, int R, int W>
class GroupFetch {
 public:
  /// where(row of the group): row of the vector, or -1 for zero.
  template <class Where>
  __device__ void locate(Where&& where) {
    next_ = where(row());
  }
  /// Asks for what was located.
  __device__ void ask(const SolveState<T>& s, const SlabBench<T, C, R, W>& b, const T* vector) {
    at_ = next_;
#pragma unroll
    for (int j = 0; j < kValues; ++j) value_[j] = T(0);
    if (at_ >= 0) load(vector + element(s, b, at_, 0));
  }
  /// Waits for the rows of half h (64 rows each), and puts them into `to`. After an abort: whatever is there.
  __device__ void take(const SolveState<T>& s, const SlabBench<T, C, R, W>& b, const T* vector, int h, T* to) {
    if (row() / 64 != h) return;
    Wait wait;
    while (any_missing() && wait.goes_on(s.control, s.patience)) load(vector + element(s, b, at_, 0));
#pragma unroll
    for (int j = 0; j < kValues; ++j) to[place(row(), column(j), kRowBlock)] = value_[j];
  }

 private:
  static constexpr int kTogether = W / kRowBlock;  ///< threads a row
  static constexpr int kValues = C / kTogether;

  __device__ static int row() { return static_cast<int>(threadIdx.x) / kTogether; }
  __device__ static int column(int j) {
    return (j / 2 * kTogether + static_cast<int>(threadIdx.x) % kTogether) * 2 + j % 2;
  }
  __device__ bool any_missing() const {
    bool any = false;
#pragma unroll
    for (int j = 0; j < kValues; ++j) any = any || is_missing(value_[j]);
    return any;
  }
  __device__ void load(const T* from) {
#pragma unroll
    for (int j = 0; j < kValues; j += 2) {
      const PairOf<T> two = load_shared_pair(from + column(j));
      value_[j] = two.x;
      value_[j + 1] = two.y;
    }
  }

  int next_, at_;
  T value_[kValues];
};

// ---- products -------------------------------------------------------------------------------------------------------

// Tensor cores take L as their second operand, in which its elements need no moves between registers, and the values of
// 16 right-hand sides (eight of them zero for one slab) as their first. So they sum for eight rows or columns of L.

/// Rows from `first` on of a vector of `rows` rows in shared memory, as products read it.
template <class T>
struct VectorView {
  const T* first;
  int rows;

  /// Column c of slab k.
  __device__ T operator()(int row, int k, int c) const { return first[(k * rows + row) * kSlab + c]; }
  __device__ VectorView from(int row) const { return {first + row * kSlab, rows}; }
};

/// The first operand: 16 rows of x(row, slab, column of the slab).
template <class T, int C, class X>
__device__ inline void load_values(T (&a)[8], X&& x) {
  const int lane = lane_of_thread(), g = lane >> 2, t = lane & 3;
#pragma unroll
  for (int u = 0; u < 8; ++u) a[u] = (u & 1) * kSlab < C ? x(4 * (u >> 1) + t, u & 1, g) : T(0);
}

/// The second operand from a panel as it lies in memory: L^T (16 columns x 8 rows).
template <class T>
__device__ inline void order_panel(const PairOf<T> (&l)[2], T (&b)[4]) {
  b[0] = l[0].x;
  b[1] = l[0].y;
  b[2] = l[1].x;
  b[3] = l[1].y;
}

/// The second operand from two panels, twice: L (16 rows x 8 columns), element by element, where 32 lanes read 256
/// bytes.
template <class T, class Load>
__device__ inline void load_transposed(const T* panels, T (&b)[2][4], Load&& load) {
  const int lane = lane_of_thread(), g = lane >> 2, t = lane & 3;
  const T* from = panels + t * 8 + (g & 3) * 2 + (g >> 2);
#pragma unroll
  for (int h = 0; h < 2; ++h)
#pragma unroll
    for (int u = 0; u < 4; ++u) b[h][u] = load(from + (u >> 1) * 128 + h * 64 + (u & 1) * 32);
}

/// Calls use(row or column of L 0..7, right-hand side, sum) for this lane's part of the sums.
template <class T, int C, class Use>
__device__ inline void for_each_sum(const T (&sum)[4], Use&& use) {
  const int lane = lane_of_thread(), g = lane >> 2, t = lane & 3;
#pragma unroll
  for (int e = 0; e < 4; ++e)
    if ((e >> 1) * kSlab < C) use(2 * t + (e & 1), g + kSlab * (e >> 1), sum[e]);
}

}  // namespace

}  // namespace espalier::device::cuda

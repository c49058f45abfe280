#include <type_traits>

#include "device/cuda/kernels/pipeline.cuh"
#include "device/cuda/kernels/selected_inverse.hpp"
#include "device/cuda/kernels/split_products.cuh"

namespace espalier::device::cuda {

namespace {

constexpr int kInverseStages = 4;

template <class T, int N>
using InverseShape = Shape<T, kInverseRows[N], kInverseCols[N]>;

/// The dynamic shared memory of a product, with its barriers made ready. Ends with a barrier.
template <class T>
__device__ inline Pipeline<T> open_pipeline(unsigned char* area, std::uint64_t* barriers) {
  if (threadIdx.x == 0)
    for (int b = 0; b < kInverseStages; ++b) barrier_init(barriers + b);
  fence_shared();
  __syncthreads();
  return {reinterpret_cast<T*>(area), barriers, kInverseStages, 0};
}

/// acc += A B^T. By all threads; starts where nobody reads the stages, and ends with a barrier.
template <class T, class S>
__device__ __forceinline__ void add_product(Accumulator<T, S>& acc, const InverseProduct<T>& p, Pipeline<T>& pipe) {
  const Corner<S> at;
  Products<T, SplitFormat::tf32, S> products(acc, {1, 1});
  const bool active = at.row < p.rows && at.col < p.cols;
#if ESPALIER_BULK_COPIES
  const unsigned bytes_a = p.rows * kChunk * sizeof(T), bytes_b = p.cols * kChunk * sizeof(T);
  const auto issue = [&](int q, int stage) {
    T* to = pipe.stages + stage * S::kStage;
    barrier_expect(pipe.barriers + stage, bytes_a + bytes_b);
    bulk_copy(to, p.chunk_a(q), bytes_a, pipe.barriers + stage);
    bulk_copy(to + S::kRows * kChunk, p.chunk_b(q), bytes_b, pipe.barriers + stage);
  };
  if (threadIdx.x == 0) {
    fence_shared();
    fence_global();
    for (int q = 0; q < min(p.chunks, pipe.depth); ++q) issue(q, q);
  }
  for (int q = 0, stage = 0; q < p.chunks; ++q) {
    pipe.wait(stage);
    const T* left = pipe.stages + stage * S::kStage;
    if (active) products.add(left, left + S::kRows * kChunk, at);
    __syncthreads();
    if (threadIdx.x == 0 && q + pipe.depth < p.chunks) issue(q + pipe.depth, stage);
    stage = stage + 1 == pipe.depth ? 0 : stage + 1;
  }
#else
  T* left = pipe.stages;
  T* right = left + S::kRows * kChunk;
  for (int q = 0; q < p.chunks; ++q) {
    const T *a = p.chunk_a(q), *b = p.chunk_b(q);
    for (int x = threadIdx.x; x < p.rows * kChunk; x += kThreads) left[x] = a[x];
    for (int x = threadIdx.x; x < p.cols * kChunk; x += kThreads) right[x] = b[x];
    __syncthreads();
    if (active) products.add(left, right, at);
    __syncthreads();
  }
#endif
  products.finish();
}

template <class T, class S>
__device__ __forceinline__ void negate(Accumulator<T, S>& acc) {
#pragma unroll
  for (int m = 0; m < S::kM; ++m)
#pragma unroll
    for (int n = 0; n < S::kN; ++n)
#pragma unroll
      for (int e = 0; e < 4; ++e) acc[m][n][e] = -acc[m][n][e];
}

template <class T, int N>
__global__ void __launch_bounds__(kThreads)
    inverse_solve(const __grid_constant__ InverseState<T> s, std::int64_t first) {
  using S = InverseShape<T, N>;
  extern __shared__ __align__(128) unsigned char area[];
  __shared__ std::uint64_t barriers[kInverseStages];
  const InverseTask task = s.tasks[first + blockIdx.x];
  const InverseFrontOf<T>& x = s.fronts[task.front];
  Pipeline<T> pipe = open_pipeline<T>(area, barriers);
  T acc[S::kM][S::kN][4] = {};
  const auto p = product_of_solve(x, task, S::kRows, S::kCols);
  add_product<T, S>(acc, p, pipe);
  const int end = x.end_of(task.block), w = end - x.begin_of(task.block);
  T* to = rows_of_block(x, task.block, task.part) + static_cast<std::int64_t>((task.col - end) / kChunk) * w * kChunk +
          task.row * kChunk;
  store_panels<T, S>(acc, T(1), to, w * kChunk, p.rows, p.cols, Corner<S>());
}

template <class T, int N>
__global__ void __launch_bounds__(kThreads, N == 2 ? 2 : 3)
    inverse_multiply(const __grid_constant__ InverseState<T> s, std::int64_t first) {
  using S = InverseShape<T, N>;
  extern __shared__ __align__(128) unsigned char area[];
  __shared__ std::uint64_t barriers[kInverseStages];
  const InverseTask task = s.tasks[first + blockIdx.x];
  const InverseFrontOf<T>& x = s.fronts[task.front];
  Pipeline<T> pipe = open_pipeline<T>(area, barriers);
  T acc[S::kM][S::kN][4] = {};
  const auto p = product_of_multiply(x, task, S::kRows, S::kCols);
  add_product<T, S>(acc, p, pipe);
  const int pad = x.front.total_pad, col = x.begin_of(task.block) + task.col;
  const Corner<S> at;
  T* const here = task.part == 0 ? x.z : x.across;
  T* const there = task.part == 0 ? x.across : x.z;
  store_panels<T, S>(acc, T(-1), here + chunked(pad, task.row, col), static_cast<std::int64_t>(pad) * kChunk, p.rows,
                     p.cols, at);
  for_each_element<S>(at, [&](int m, int n, int e, int r, int c) {
    if (r < p.rows && c < p.cols) there[chunked(pad, col + c, task.row + r)] = -acc[m][n][e];
  });
}

template <class T>
__global__ void __launch_bounds__(kThreads)
    inverse_diagonal(const __grid_constant__ InverseState<T> s, std::int64_t first) {
  using S = InverseShape<T, 0>;
  extern __shared__ __align__(128) unsigned char area[];
  __shared__ std::uint64_t barriers[kInverseStages];
  const InverseTask task = s.tasks[first + blockIdx.x];
  const InverseFrontOf<T>& x = s.fronts[task.front];
  Pipeline<T> pipe = open_pipeline<T>(area, barriers);
  T acc[S::kM][S::kN][4] = {};
  add_product<T, S>(acc, product_of_diagonal(x, task, S::kRows, S::kCols), pipe);
  negate<T, S>(acc);
  const auto p = product_of_inverses(x, task, S::kRows, S::kCols);
  add_product<T, S>(acc, p, pipe);
  const int pad = x.front.total_pad, begin = x.begin_of(task.block);
  const bool symmetric = s.kind != Kind::lu;
  for_each_element<S>(Corner<S>(), [&](int m, int n, int e, int r, int c) {
    const int row = begin + task.row + r, col = begin + task.col + c;
    if (r >= p.rows || c >= p.cols || (symmetric && row < col)) return;
    x.z[chunked(pad, row, col)] = acc[m][n][e];
    if (!symmetric || row != col) x.across[chunked(pad, col, row)] = acc[m][n][e];
  });
}

/// M^T and V^T of a block.
template <class T>
__global__ void __launch_bounds__(kThreads)
    inverse_begin(const __grid_constant__ InverseState<T> s, std::int64_t first) {
  const InverseTask task = s.tasks[first + blockIdx.x];
  const InverseFrontOf<T>& x = s.fronts[task.front];
  const int begin = x.begin_of(task.block), w = x.end_of(task.block) - begin, block = task.block;
  const std::int64_t at = static_cast<std::int64_t>(begin) * x.widest();
  const bool llt = s.kind == Kind::llt;
  for (int y = threadIdx.x; y < w * w; y += kThreads) {
    const int row = y % w, col = y / w;  // of M
    const std::int64_t to = at + chunked(w, col, row);
    x.m[to] = inverse_element(x, x.factor, block, row, col, llt);
    if (!llt) x.v[to] = second_element(x, s.kind, s.inverse_d, s.inverse_e, block, row, col);
  }
}

/// What the parent knows of the rows below the pivots.
template <class T>
__global__ void __launch_bounds__(kThreads)
    inverse_gather(const __grid_constant__ InverseState<T> s, std::int64_t first) {
  const InverseTask task = s.tasks[first + blockIdx.x];
  const InverseFrontOf<T>& x = s.fronts[task.front];
  const InverseFrontOf<T>& parent = s.fronts[x.parent < 0 ? task.front : x.parent];
  const int pad = x.front.total_pad, rows = min(kGatherRows, pad - task.row);
  T* const to = (task.part == 0 ? x.z : x.across) + chunked(pad, task.row, task.col);
  const T* const from = task.part == 0 ? parent.z : parent.across;
  for (int y = threadIdx.x; y < rows * kChunk; y += kThreads) {
    const int inner = y % 128;
    const int r = task.row + y / 128 * kPanel + (inner % 64 >> 3);
    const int c = task.col + (inner >> 6) * 8 + (inner >> 1 & 3) + 4 * (inner & 1);
    const int row = row_of_parent(x.front, parent.front, s.relative, r);
    const int col = row_of_parent(x.front, parent.front, s.relative, c);
    to[y] = row >= 0 && col >= 0 && x.parent >= 0 ? from[chunked(parent.front.total_pad, row, col)] : T(0);
  }
}

template <class T>
__global__ void __launch_bounds__(kThreads)
    inverse_read(const __grid_constant__ InverseState<T> s, std::int64_t begin, std::int64_t end) {
  const std::int64_t at = begin + static_cast<std::int64_t>(blockIdx.x) * kThreads + threadIdx.x;
  if (at < end) s.entry[at] = s.stack[s.address[at]];
}

template <class T, int N>
constexpr int shared_bytes() {
  return kInverseStages * InverseShape<T, N>::kStage * static_cast<int>(sizeof(T));
}

template <class T, int N>
cudaError_t prepare_shape() {
  for (const auto kernel : {inverse_solve<T, N>, inverse_multiply<T, N>})
    if (const auto e = cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, shared_bytes<T, N>()))
      return e;
  return cudaSuccess;
}

// use(shape as a constant)
template <class Use>
void with_shape(int shape, Use&& use) {
  if (shape == 0)
    use(std::integral_constant<int, 0>());
  else if (shape == 1)
    use(std::integral_constant<int, 1>());
  else
    use(std::integral_constant<int, 2>());
}

}  // namespace

template <class T>
cudaError_t prepare_inverse() {
  if (const auto e = prepare_shape<T, 0>()) return e;
  if (const auto e = prepare_shape<T, 1>()) return e;
  if (const auto e = prepare_shape<T, 2>()) return e;
  return cudaFuncSetAttribute(inverse_diagonal<T>, cudaFuncAttributeMaxDynamicSharedMemorySize, shared_bytes<T, 0>());
}

template <class T>
cudaError_t launch_inverse(const InverseState<T>& s, const InverseLaunch& l, cudaStream_t stream) {
  if (l.end <= l.begin) return cudaSuccess;
  if (l.work == InverseWork::read) {
    const auto blocks = static_cast<unsigned>((l.end - l.begin + kThreads - 1) / kThreads);
    inverse_read<T><<<blocks, kThreads, 0, stream>>>(s, l.begin, l.end);
    return cudaGetLastError();
  }
  const auto blocks = static_cast<unsigned>(l.end - l.begin);
  switch (l.work) {
    case InverseWork::gather:
      inverse_gather<T><<<blocks, kThreads, 0, stream>>>(s, l.begin);
      break;
    case InverseWork::begin:
      inverse_begin<T><<<blocks, kThreads, 0, stream>>>(s, l.begin);
      break;
    case InverseWork::diagonal:
      inverse_diagonal<T><<<blocks, kThreads, shared_bytes<T, 0>(), stream>>>(s, l.begin);
      break;
    case InverseWork::solve:
      with_shape(l.shape, [&](auto shape) {
        constexpr int kShape = decltype(shape)::value;
        inverse_solve<T, kShape><<<blocks, kThreads, shared_bytes<T, kShape>(), stream>>>(s, l.begin);
      });
      break;
    default:
      with_shape(l.shape, [&](auto shape) {
        constexpr int kShape = decltype(shape)::value;
        inverse_multiply<T, kShape><<<blocks, kThreads, shared_bytes<T, kShape>(), stream>>>(s, l.begin);
      });
  }
  return cudaGetLastError();
}

#define ESPALIER_INSTANTIATE(T)              \
  template cudaError_t prepare_inverse<T>(); \
  template cudaError_t launch_inverse(const InverseState<T>&, const InverseLaunch&, cudaStream_t);
ESPALIER_INSTANTIATE(double)
ESPALIER_INSTANTIATE(float)
#undef ESPALIER_INSTANTIATE

}  // namespace espalier::device::cuda

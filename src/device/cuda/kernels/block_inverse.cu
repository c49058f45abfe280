#include "device/cuda/kernels/block_inverse.hpp"
#include "device/cuda/kernels/diagonal.cuh"

namespace espalier::device::cuda {

namespace {

constexpr int kMostJoined = kRowBlock / 2;  ///< rows and columns of what is joined
constexpr int kLd = kMostJoined + 4;        ///< of scratch in shared memory, column-major
constexpr int kBuffer = kLd * kMostJoined;

/// to = rows [row, row + rows) of columns [col, col + cols) of a factor array; zero above the diagonal tiles. A warp
/// asks for several panels before it stores one.
template <class T>
__device__ void read_block(const Front& f, const T* factor, int row, int rows, int col, int cols, T* to) {
  constexpr int kAtOnce = 4, kWarps = kThreads / 32;
  const int warp = static_cast<int>(threadIdx.x) >> 5, lane = static_cast<int>(threadIdx.x) & 31;
  const int panels = rows / kPanel, count = panels * (cols / kChunk);
  for (int x0 = warp; x0 < count; x0 += kAtOnce * kWarps) {
    PairOf<T> two[kAtOnce][2];
#pragma unroll
    for (int i = 0; i < kAtOnce; ++i) {
      const int x = min(x0 + i * kWarps, count - 1), r = row + x % panels * kPanel, c = col + x / panels * kChunk;
      const bool there = r >= c >> f.width_log2 << f.width_log2;
      const auto* from = reinterpret_cast<const PairOf<T>*>(factor + f.chunk_offset(c / kChunk, there ? r : c)) + lane;
#pragma unroll
      for (int h = 0; h < 2; ++h) two[i][h] = there ? __ldcg(from + 32 * h) : PairOf<T>{};
    }
#pragma unroll
    for (int i = 0; i < kAtOnce; ++i) {
      const int x = x0 + i * kWarps;
      if (x >= count) continue;
      T* at = to + (x / panels * kChunk + (lane & 3)) * kLd + x % panels * kPanel + (lane >> 2);
#pragma unroll
      for (int h = 0; h < 2; ++h) {
        at[8 * h * kLd] = two[i][h].x;
        at[(8 * h + 4) * kLd] = two[i][h].y;
      }
    }
  }
}

/// Fragments of 16 x 8 of a product of at most kMostJoined rows and columns: a warp has eight of them at most.
template <class T>
struct Fragments {
  static constexpr int kMost = kMostJoined / 16 * (kMostJoined / 8) / (kThreads / 32);
  T sum[kMost][4] = {};
  int rows, cols;

  __device__ Fragments(int r, int c) : rows(r), cols(c) {}

  /// use(sums, first row, first column)
  template <class Use>
  __device__ void for_each(Use&& use) {
    const int warp = static_cast<int>(threadIdx.x) >> 5, down = rows / 16;
#pragma unroll
    for (int i = 0; i < kMost; ++i)
      if (const int x = warp + i * (kThreads / 32); x < down * (cols / 8)) use(sum[i], x % down * 16, x / down * 8);
  }
  /// sums += A B with `inner` columns of A.
  __device__ void multiply(const T* a, const T* b, int inner) {
    for_each([&](T(&c)[4], int row, int col) {
#pragma unroll 1
      for (int k = 0; k < inner; k += 16) multiply_shared(c, a + k * kLd + row, 1, kLd, b + col * kLd + k, 1, kLd);
    });
  }
  __device__ void store(T sign, T* to) {
    for_each([&](const T(&c)[4], int row, int col) { put_shared(c, sign, false, to + col * kLd + row, 1, kLd); });
  }
};

/// P = -M2 L21 M1 for the inverses of `size` pivots from `col` on and of the `next` pivots after them.
template <class T>
__device__ void join(const Front& f, T* factor, int col, int size, int next, T* area) {
  T* const one = area;
  T* const two = area + kBuffer;
  const int row = col + size;
  read_block(f, factor, col, size, col, size, one);  // M1
  read_block(f, factor, row, next, col, size, two);  // L21
  __syncthreads();
  Fragments<T> z(next, size);
  z.multiply(two, one, size);
  __syncthreads();
  z.store(T(1), one);                                // L21 M1
  read_block(f, factor, row, next, row, next, two);  // M2
  __syncthreads();
  Fragments<T> p(next, size);
  p.multiply(two, one, next);
  __syncthreads();
  p.store(T(-1), two);
  __syncthreads();
  for (int c = 0; c < size; c += f.width)
    write_panels(two + c * kLd, 1, kLd, next, f.width, factor + f.chunk_offset((col + c) / kChunk, row),
                 static_cast<std::int64_t>(f.total_pad - (col + c)) * kChunk);
  __syncthreads();
}

/// Waits for what other devices make of the block.
template <class T>
__device__ void await_block(const FactorState<T>& s, const Front& f, int block) {
  if (s.peers.count == 1 || f.region != 0) return;
  const int per_block = kRowBlock >> f.width_log2, first = block * per_block;
  const int j = first + static_cast<int>(threadIdx.x), last = min(first + per_block, f.pivot_tiles) - 1;
  if (j <= last) wait_for(s.flags(0) + f.diagonal_flag(j), 1, s.control, s.patience);
  if (j < last) wait_for(s.flags(0) + f.flag(block, j), 1, s.control, s.patience);
  __syncthreads();
}

/// A block of threads for each block of pivots.
template <class T>
__global__ void __launch_bounds__(kThreads)
    join_kernel(const __grid_constant__ FactorState<T> s, const SolveTask* __restrict__ blocks) {
  extern __shared__ __align__(128) unsigned char area[];
  const SolveTask task = blocks[blockIdx.x];
  const Front f = s.fronts[task.front];
  await_block(s, f, task.block);
  if (aborted(s.control)) return;
  T* const factor = s.base[f.region] + f.factor;
  const int first = f.block_begin(task.block), end = f.block_end(task.block);
  for (int size = f.width; size < end - first; size *= 2)
    for (int col = first; col + size < end; col += 2 * size)
      join(f, factor, col, size, min(size, end - col - size), reinterpret_cast<T*>(area));
}

}  // namespace

template <class T>
cudaError_t launch_block_inverses(const FactorState<T>& state, const SolveTask* blocks, int count,
                                  cudaStream_t stream) {
  if (count == 0) return cudaSuccess;
  constexpr int kBytes = 2 * kBuffer * static_cast<int>(sizeof(T));
  const auto kernel = join_kernel<T>;
  if (const auto e = cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, kBytes)) return e;
  kernel<<<count, kThreads, kBytes, stream>>>(state, blocks);
  return cudaGetLastError();
}

template cudaError_t launch_block_inverses<double>(const FactorState<double>&, const SolveTask*, int, cudaStream_t);
template cudaError_t launch_block_inverses<float>(const FactorState<float>&, const SolveTask*, int, cudaStream_t);

}  // namespace espalier::device::cuda

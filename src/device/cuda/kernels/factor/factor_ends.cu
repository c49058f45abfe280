#include <algorithm>
#include <type_traits>

#include "device/cuda/kernels/block_sums.cuh"
#include "device/cuda/kernels/factor/factor_ends.hpp"
#include "device/cuda/tables/needed_values.hpp"
#include "device/cuda/tables/pivot_pair.hpp"

namespace espalier::device::cuda {

namespace {

constexpr int kThreadsOfBlock = 256;
constexpr Index kPivotsOfThread = 4;  // at most, while there are blocks enough
constexpr int kMostJudges = 512;

/// mantissa * 2^exponent, the mantissa in [1, 2) but for zero and what is not finite.
struct Product {
  double mantissa = 1;
  long long exponent = 0;

  __device__ void normalize() {
    if (mantissa == 0 || !is_finite(mantissa)) return;
    if (fabs(mantissa) < 0x1p-1022) {  // a subnormal factor; products lie in [1, 4)
      mantissa *= 0x1p54;
      exponent -= 54;
    }
    const int high = __double2hiint(mantissa);
    exponent += ((high >> 20) & 0x7ff) - 1023;
    mantissa = __hiloint2double((high & ~0x7ff00000) | 0x3ff00000, __double2loint(mantissa));
  }
  __device__ void multiply(Product other) {
    mantissa *= other.mantissa;
    exponent += other.exponent;
    normalize();
  }
  __device__ Product from_lane(int d) const {
    return {__shfl_xor_sync(0xffffffffu, mantissa, d), __shfl_xor_sync(0xffffffffu, exponent, d)};
  }
};

/// Product over the block's threads in a fixed order, and the sum of their counts; for thread 0 alone.
__device__ void combine(Product& product, int& small) {
  __shared__ PivotProduct warps[kThreadsOfBlock / 32];
  const auto over_lanes = [&](int width) {
    for (int d = 1; d < width; d *= 2) {
      product.multiply(product.from_lane(d));
      small += __shfl_xor_sync(0xffffffffu, small, d);
    }
  };
  over_lanes(32);
  if (threadIdx.x % 32 == 0) warps[threadIdx.x / 32] = {product.mantissa, product.exponent, small};
  __syncthreads();
  if (threadIdx.x < 32) {
    const PivotProduct mine = threadIdx.x < kThreadsOfBlock / 32 ? warps[threadIdx.x] : PivotProduct{1, 0, 0};
    product = {mine.mantissa, mine.exponent};
    small = mine.small;
    over_lanes(kThreadsOfBlock / 32);
  }
  __syncthreads();
}

__device__ double largest_part(const double* largest, int parts) {
  double most = 0;
  for (int k = static_cast<int>(threadIdx.x); k < parts; k += kThreadsOfBlock) most = larger(most, largest[k]);
  return largest_of_block(most);
}

template <class Job>
__device__ void complete_limits(const Job& job, double largest) {
  using T = std::remove_pointer_t<decltype(job.limits)>;
  job.limits[0] = static_cast<T>(job.tiny * largest);
  job.limits[2] = static_cast<T>(job.suspect * largest);
  job.limits[3] = static_cast<T>(largest);
}

/// The mark of pivot k of ldlt or lu; 0: it is not small. Each of a pair's eigenvalues stands at one of its two places.
template <class T>
__device__ int mark_of(const FactorJudge<T>& job, Index k, const T* pivots) {
  const auto suspect = static_cast<double>(job.limits[2]);
  double pivot = static_cast<double>(pivots[k]);
  if (job.pairs) {
    const T *d = pivots + job.n, *e = d + job.n;
    const bool first = e[k] != T(0);
    const bool after = k > 0 && (job.owner == nullptr || job.owner[k - 1] == job.owner[k]);  // of the same memory
    if (first || (after && e[k - 1] != T(0))) {
      const Index at = first ? k : k - 1;
      pivot = pair_of_pivots(d[at], e[at], d[at + 1]).value[first ? 0 : 1];
    }
  }
  if (!(fabs(pivot) < suspect)) return 0;
  return job.pairs && pivot < 0 ? kPivotSmall | kPivotSmallNegative : kPivotSmall;
}

template <class T>
__global__ void begin_kernel(const FactorBegin<T> job) {
  const Offset first = static_cast<Offset>(blockIdx.x) * kThreadsOfBlock + threadIdx.x;
  const Offset step = static_cast<Offset>(gridDim.x) * kThreadsOfBlock;
  for (Offset k = kCounters + first; k < job.control_size; k += step) job.control[k] = 0;
  for (Offset k = first; k < job.marks_size; k += step) job.marks[k] = 0;
  if (blockIdx.x != 0) return;
  const double largest = job.largest != nullptr ? largest_part(job.largest, job.parts) : 1;
  if (threadIdx.x < kCounters && threadIdx.x != kAborted) job.control[threadIdx.x] = 0;
  if (threadIdx.x != 0) return;
  job.control[kAborted] = is_finite(largest) ? 0 : 1;
  if (job.largest != nullptr) complete_limits(job, largest);
}

// A warp takes a chunk, several in flight: a read from another GPU takes more than a microsecond.
template <class T>
__global__ void take_kernel(const FactorTake<T> job) {
  constexpr int kInFlight = 4;
  const Offset warp = (static_cast<Offset>(blockIdx.x) * kThreadsOfBlock + threadIdx.x) / 32;
  const Offset warps = static_cast<Offset>(gridDim.x) * (kThreadsOfBlock / 32);
  const auto lane = static_cast<Offset>(threadIdx.x % 32);
  for (Offset first = warp * kInFlight; first < job.chunk_count; first += warps * kInFlight) {
    Offset at[kInFlight];
    T value[kInFlight];
    for (int k = 0; k < kInFlight; ++k) {
      at[k] = first + k < job.chunk_count ? job.chunks[first + k] * kValueChunk + lane : job.values;
      if (at[k] < job.values) value[k] = job.from[at[k]];
    }
    for (int k = 0; k < kInFlight; ++k)
      if (at[k] < job.values) job.to[at[k]] = value[k];
  }
  if (blockIdx.x != 0 || job.largest == nullptr) return;
  const double largest = largest_part(job.largest, job.parts);
  if (threadIdx.x != 0) return;
  if (!is_finite(largest)) job.control[kAborted] = 1;
  complete_limits(job, largest);
}

template <class T>
__global__ void judge_kernel(const FactorJudge<T> job) {
  Product product;
  int small = 0;
  const Offset step = static_cast<Offset>(gridDim.x) * kThreadsOfBlock;
  for (Offset k = static_cast<Offset>(blockIdx.x) * kThreadsOfBlock + threadIdx.x; k < job.n; k += step) {
    const int owner = job.owner != nullptr ? job.owner[k] : 0;
    const double pivot = static_cast<double>(job.pivots[owner][k]);
    Product factor{pivot, 0};
    factor.normalize();
    product.multiply(factor);
    int mark = 0;
    if (job.limits != nullptr)
      mark = mark_of(job, k, job.pivots[owner]);
    else if (job.diagonal != nullptr && pivot <= job.rounding * static_cast<double>(job.values[job.diagonal[k]]))
      mark = kPivotReplaced;
    if (mark == 0 || job.marks[k] != 0) continue;
    job.marks[k] = static_cast<unsigned char>(mark);
    ++small;
  }
  combine(product, small);
  if (threadIdx.x == 0) job.products[blockIdx.x] = {product.mantissa, product.exponent, small};
  if (!last_block(job.ticket)) return;
  product = {};
  small = 0;
  for (unsigned k = threadIdx.x; k < gridDim.x; k += kThreadsOfBlock) {
    const PivotProduct p = job.products[k];
    product.multiply({p.mantissa, p.exponent});
    small += p.small;
  }
  combine(product, small);
  const double largest = job.largest != nullptr ? largest_part(job.largest, job.parts) : 1;
  FactorEnd& end = *job.end;
  if (threadIdx.x < kCounters) end.counters[threadIdx.x] = job.control[threadIdx.x];
  if (threadIdx.x != 0) return;
  end.small = small;
  end.sign = product.mantissa < 0 ? -1 : (product.mantissa > 0 ? 1 : 0);
  end.mantissa = fabs(product.mantissa);
  end.exponent = product.exponent;
  end.largest = largest;
}

}  // namespace

int judge_blocks(Index n) {
  constexpr Index kEach = kThreadsOfBlock * kPivotsOfThread;
  return static_cast<int>(std::min<Index>((n + kEach - 1) / kEach, kMostJudges));
}

template <class T>
cudaError_t launch_begin(const FactorBegin<T>& job, cudaStream_t stream) {
  constexpr Offset kEach = kThreadsOfBlock * 8;
  const Offset blocks = (std::max(job.control_size, job.marks_size) + kEach - 1) / kEach;
  begin_kernel<T><<<static_cast<unsigned>(std::min<Offset>(blocks, 1056)), kThreadsOfBlock, 0, stream>>>(job);
  return cudaGetLastError();
}

template <class T>
cudaError_t launch_take(const FactorTake<T>& job, cudaStream_t stream) {
  constexpr Offset kEach = kThreadsOfBlock / 32 * 4;
  const Offset blocks = std::max<Offset>(1, (job.chunk_count + kEach - 1) / kEach);
  take_kernel<T><<<static_cast<unsigned>(std::min<Offset>(blocks, 1056)), kThreadsOfBlock, 0, stream>>>(job);
  return cudaGetLastError();
}

template <class T>
cudaError_t launch_judge(const FactorJudge<T>& job, cudaStream_t stream) {
  judge_kernel<T><<<static_cast<unsigned>(judge_blocks(job.n)), kThreadsOfBlock, 0, stream>>>(job);
  return cudaGetLastError();
}

template cudaError_t launch_begin(const FactorBegin<double>&, cudaStream_t);
template cudaError_t launch_begin(const FactorBegin<float>&, cudaStream_t);
template cudaError_t launch_take(const FactorTake<double>&, cudaStream_t);
template cudaError_t launch_take(const FactorTake<float>&, cudaStream_t);
template cudaError_t launch_judge(const FactorJudge<double>&, cudaStream_t);
template cudaError_t launch_judge(const FactorJudge<float>&, cudaStream_t);

}  // namespace espalier::device::cuda

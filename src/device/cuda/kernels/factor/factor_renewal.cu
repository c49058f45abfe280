#include "device/cuda/kernels/factor/factor_renewal.hpp"

namespace espalier::device::cuda {

namespace {

constexpr int kThreadsOfBlock = 256;

struct PivotCounts {
  int negative = 0, pairs = 0;
};

/// What the factorization has counted for position k of a front: of the two of a pair the first counts for both. That
/// of a search for the largest is negative and positive; else both eigenvalues have the sign of its diagonal.
template <class T>
__device__ PivotCounts counts_of(const FactorRenewal<T>& job, Index k, Index first) {
  const T *d = job.pivots + job.n, *e = d + job.n;
  if (k > first && e[k - 1] != T(0)) return {};
  if (e[k] == T(0)) return {job.pivots[k] < T(0) ? 1 : 0, 0};
  return {job.pivots[k] < T(0) ? 1 : (d[k + 1] < T(0) ? 2 : 0), 1};
}

/// A warp takes a front.
template <class T>
__global__ void __launch_bounds__(kThreadsOfBlock) renewal_kernel(const FactorRenewal<T> job) {
  constexpr Index kWarps = kThreadsOfBlock / 32;
  const auto lane = static_cast<Index>(threadIdx.x % 32);
  const Index step = static_cast<Index>(gridDim.x) * kWarps;
  PivotCounts mine;
  for (Index f = static_cast<Index>(blockIdx.x) * kWarps + static_cast<Index>(threadIdx.x / 32); f < job.count;
       f += step) {
    const Front& front = job.fronts[f];
    if (job.made[f] != 0) {
      for (int part = 0; part < job.parts; ++part)
        for (std::int64_t k = lane; k < front.flags(); k += 32) job.flags[part * job.part_flags + front.flag0 + k] = 0;
      if (lane == 0) job.finished[f] = 0;
    } else if (job.pivots != nullptr && __ffs(front.members) - 1 == job.self) {
      for (Index k = front.position + lane; k < front.position + front.pivots; k += 32) {
        const PivotCounts more = counts_of(job, k, front.position);
        mine.negative += more.negative;
        mine.pairs += more.pairs;
      }
    }
  }
  if (job.pivots == nullptr) return;
  for (int d = 16; d > 0; d /= 2) {
    mine.negative += __shfl_xor_sync(0xffffffffu, mine.negative, d);
    mine.pairs += __shfl_xor_sync(0xffffffffu, mine.pairs, d);
  }
  if (lane != 0) return;
  if (mine.negative > 0) atomicAdd(job.control + kNegative, mine.negative);
  if (mine.pairs > 0) atomicAdd(job.control + kTwoByTwo, mine.pairs);
}

}  // namespace

template <class T>
cudaError_t launch_renewal(const FactorRenewal<T>& job, cudaStream_t stream) {
  constexpr Index kFrontsOfBlock = kThreadsOfBlock / 32, kMostBlocks = 1056;
  const Index blocks = (job.count + kFrontsOfBlock - 1) / kFrontsOfBlock;
  renewal_kernel<T>
      <<<static_cast<unsigned>(blocks < kMostBlocks ? blocks : kMostBlocks), kThreadsOfBlock, 0, stream>>>(job);
  return cudaGetLastError();
}

template cudaError_t launch_renewal(const FactorRenewal<double>&, cudaStream_t);
template cudaError_t launch_renewal(const FactorRenewal<float>&, cudaStream_t);

}  // namespace espalier::device::cuda

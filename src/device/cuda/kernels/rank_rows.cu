#include <algorithm>

#include "device/cuda/kernels/rank_rows.hpp"

namespace espalier::device::cuda {

namespace {

constexpr int kGatherThreads = 256;

template <class T>
__global__ void gather_rows_kernel(const RankRowsJob<T> job) {
  const Offset step = static_cast<Offset>(gridDim.x) * kGatherThreads;
  const Offset count = job.rows * job.columns;
  for (Offset k = static_cast<Offset>(blockIdx.x) * kGatherThreads + threadIdx.x; k < count; k += step)
    job.to[k] = job.from[job.owner[k / job.columns]][k];
}

}  // namespace

template <class T>
cudaError_t launch_gather_rows(const RankRowsJob<T>& job, cudaStream_t stream) {
  const Offset blocks = (job.rows * job.columns + kGatherThreads - 1) / kGatherThreads;
  gather_rows_kernel<T><<<static_cast<unsigned>(std::clamp<Offset>(blocks, 1, 1056)), kGatherThreads, 0, stream>>>(job);
  return cudaGetLastError();
}

template cudaError_t launch_gather_rows(const RankRowsJob<double>&, cudaStream_t);
template cudaError_t launch_gather_rows(const RankRowsJob<float>&, cudaStream_t);

}  // namespace espalier::device::cuda

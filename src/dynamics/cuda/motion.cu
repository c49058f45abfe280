#include <algorithm>
#include <utility>

#include "dynamics/cuda/motion.hpp"

namespace espalier::dynamics::cuda {

namespace {

constexpr int kThreads = 256;
constexpr Offset kBlock = 8 * kThreads;  // coordinates of a record

__device__ Offset this_thread() { return static_cast<Offset>(blockIdx.x) * blockDim.x + threadIdx.x; }

template <class Loop>
__global__ void loop_kernel(const MotionArrays arrays, const Loop loop, Offset first, Offset count) {
  const Offset k = this_thread();
  if (k < count) loop(arrays, static_cast<std::size_t>(first + k));
}

// The records of all threads of a block, joined in a fixed order, to the first thread.
__device__ MotionRecord join_block(const MotionRecord& own) {
  __shared__ MotionRecord all[kThreads];
  all[threadIdx.x] = own;
  __syncthreads();
  for (unsigned step = kThreads / 2; step > 0; step /= 2) {
    if (threadIdx.x < step) MotionMeasure::join(all[threadIdx.x], all[threadIdx.x + step]);
    __syncthreads();
  }
  return all[0];
}

__global__ void measure_kernel(const MotionArrays arrays, const MotionMeasure what, Offset first, Offset count,
                               MotionRecord* records) {
  const Offset begin = static_cast<Offset>(blockIdx.x) * kBlock, end = min(begin + kBlock, count);
  MotionRecord own{};
  for (Offset k = begin + threadIdx.x; k < end; k += kThreads)
    what.add(arrays, static_cast<std::size_t>(first + k), own);
  const MotionRecord all = join_block(own);
  if (threadIdx.x == 0) records[blockIdx.x] = all;
}

// One block.
__global__ void join_kernel(Offset count, const MotionRecord* records, MotionRecord* to) {
  MotionRecord own{};
  for (Offset k = threadIdx.x; k < count; k += kThreads) MotionMeasure::join(own, records[k]);
  const MotionRecord all = join_block(own);
  if (threadIdx.x == 0) *to = all;
}

__global__ void gather_kernel(Offset count, const Index* list, const double* from, double* to) {
  const Offset k = this_thread();
  if (k < count) to[k] = from[list[k]];
}

__global__ void scatter_kernel(Offset count, const Index* list, const double* values, bool add, double* to) {
  const Offset k = this_thread();
  if (k < count) to[list[k]] = add ? to[list[k]] + values[k] : values[k];
}

}  // namespace

CudaMotion::CudaMotion(const Sizes& sizes, const MotionDemand& demand, const DeviceShare& share, Gpu& gpu)
    : gpu_(gpu), points_(demand.points), ranges_(share.ranges), blocks_(0) {
  const DeviceGuard guard(gpu_.number);
  const Offset n = sizes.velocity, rows = n + sizes.constraints;
  const Offset numbers = (std::ssize(demand.vectors) + 3 * points_) * n + std::ssize(demand.right_sides) * rows;
  vectors_ = make_array<double>(numbers, gpu_);
  call("cudaMemsetAsync(vectors)", [&] {
    return cudaMemsetAsync(vectors_.data(), 0, static_cast<std::size_t>(vectors_.bytes()), gpu_.stream.get());
  });
  double* next = vectors_.data();
  for (const MotionVector vector : demand.vectors) arrays_.*vector = std::exchange(next, next + n);
  for (int j = 0; j < points_; ++j)
    for (auto* past : {&arrays_.past_q, &arrays_.past_v, &arrays_.past_theta})
      (*past)[j] = std::exchange(next, next + n);
  for (const MotionVector vector : demand.right_sides) arrays_.*vector = std::exchange(next, next + rows);
  std::vector<Index> right_side(share.own);
  for (Offset i = n; i < rows; ++i) right_side.push_back(static_cast<Index>(i));
  seen_ = upload<Index>(share.seen, gpu_);
  right_side_ = upload<Index>(right_side, gpu_);
  const Offset longest = std::max({seen_.size(), right_side_.size(), Offset{1}});
  gathered_ = make_array<double>(kMostGathered * longest, gpu_);
  gathered_on_host_ = PinnedArray<double>(kMostGathered * longest);
  for (const DeviceShare::Range& r : ranges_) blocks_ += (r.count + kBlock - 1) / kBlock;
  records_ = make_array<MotionRecord>(blocks_ + 1, gpu_);
  record_ = PinnedArray<MotionRecord>(1);
  gpu_.stream.wait();
}

void CudaMotion::turn_past() {
  for (auto* past : {&arrays_.past_q, &arrays_.past_v, &arrays_.past_theta})
    std::rotate(*past, *past + points_ - 1, *past + points_);
}

void CudaMotion::run(const MotionLoop& loop) {
  const DeviceGuard guard(gpu_.number);
  std::visit(
      [&](const auto& of_kind) {
        for (const DeviceShare::Range& r : ranges_) {
          loop_kernel<<<blocks_for(r.count, kThreads), kThreads, 0, gpu_.stream.get()>>>(arrays_, of_kind, Offset{r.v},
                                                                                         Offset{r.count});
          call("launch of a loop over coordinates", [&] { return cudaGetLastError(); });
        }
      },
      loop);
}

MotionRecord CudaMotion::measure(const MotionMeasure& what) {
  const DeviceGuard guard(gpu_.number);
  const cudaStream_t stream = gpu_.stream.get();
  Offset block = 0;
  for (const DeviceShare::Range& r : ranges_) {
    const Offset own = (r.count + kBlock - 1) / kBlock;
    measure_kernel<<<static_cast<unsigned>(own), kThreads, 0, stream>>>(arrays_, what, Offset{r.v}, Offset{r.count},
                                                                        records_.data() + block);
    call("launch of a measurement", [&] { return cudaGetLastError(); });
    block += own;
  }
  MotionRecord* const all = records_.data() + blocks_;
  join_kernel<<<1, kThreads, 0, stream>>>(blocks_, records_.data(), all);
  call("launch of the joining of records", [&] { return cudaGetLastError(); });
  call("cudaMemcpyAsync(record)",
       [&] { return cudaMemcpyAsync(record_.data(), all, sizeof(MotionRecord), cudaMemcpyDeviceToHost, stream); });
  gpu_.stream.wait();
  return *record_.data();
}

void CudaMotion::send(ConstSpan from, double* to) {
  const DeviceGuard guard(gpu_.number);
  gpu_.send(from, to);
}

void CudaMotion::fetch(const double* from, Span to) {
  const DeviceGuard guard(gpu_.number);
  gpu_.fetch(from, to);
}

ConstSpan CudaMotion::gather(List list, std::span<const double* const> from) {
  const DeviceGuard guard(gpu_.number);
  const DeviceArray<Index>& places = of(list);
  const Offset count = places.size(), all = count * static_cast<Offset>(from.size());
  if (count == 0) return {};
  for (std::size_t k = 0; k < from.size(); ++k) {
    gather_kernel<<<blocks_for(count, kThreads), kThreads, 0, gpu_.stream.get()>>>(
        count, places.data(), from[k], gathered_.data() + static_cast<Offset>(k) * count);
    call("launch of a gather", [&] { return cudaGetLastError(); });
  }
  copy(gathered_on_host_.data(), gathered_.data(), all, cudaMemcpyDeviceToHost, gpu_);
  gpu_.stream.wait();
  return {gathered_on_host_.data(), static_cast<std::size_t>(all)};
}

void CudaMotion::scatter(List list, ConstSpan values, double* to, bool add) {
  if (values.empty()) return;
  const DeviceGuard guard(gpu_.number);
  const DeviceArray<Index>& places = of(list);
  const Offset count = places.size();
  gpu_.send(values, gathered_.data());
  scatter_kernel<<<blocks_for(count, kThreads), kThreads, 0, gpu_.stream.get()>>>(count, places.data(),
                                                                                  gathered_.data(), add, to);
  call("launch of a scatter", [&] { return cudaGetLastError(); });
}

}  // namespace espalier::dynamics::cuda

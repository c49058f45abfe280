#include "dynamics/cuda/carrier.hpp"

namespace espalier::dynamics::cuda {

namespace {

constexpr int kThreads = 256;

__device__ Offset this_thread() { return static_cast<Offset>(blockIdx.x) * blockDim.x + threadIdx.x; }

// One thread per number: those of the part's vertices, side by side.
__global__ void gather_kernel(Offset numbers, const Index* of_body, const double* from, double* to) {
  const Offset k = this_thread();
  if (k < numbers) to[k] = from[Offset{3} * of_body[k / 3] + k % 3];
}

// One thread per number of the part's own vertices, to their places in the body.
__global__ void scatter_kernel(Offset numbers, const Index* owned, const Index* of_body, const double* from,
                               double* to) {
  const Offset k = this_thread();
  if (k >= numbers) return;
  const Index vertex = owned[k / 3];
  to[Offset{3} * of_body[vertex] + k % 3] = from[Offset{3} * vertex + k % 3];
}

// One thread per number of K.
__global__ void add_kernel(Offset numbers, const Offset* positions, const double* from, double* values) {
  const Offset k = this_thread();
  if (k < numbers) values[positions[k / 3] + k % 3] += from[k];
}

void wait_for(const device::cuda::Event& event, cudaStream_t stream) {
  call("cudaStreamWaitEvent", [&] { return cudaStreamWaitEvent(stream, event.get(), 0); });
}

void copy_between(double* to, const Gpu& there, const double* from, const Gpu& here, Offset count,
                  cudaStream_t stream) {
  call("cudaMemcpyPeerAsync", [&] {
    return cudaMemcpyPeerAsync(to, there.number, from, here.number, static_cast<std::size_t>(count) * sizeof(double),
                               stream);
  });
}

}  // namespace

CudaCarrier::CudaCarrier(const BodySubdomain& part, Gpu& first, Gpu& own)
    : first_(first), own_(own), vertices_(static_cast<Offset>(part.vertices.size())) {
  {
    const DeviceGuard guard(first_.number);
    landing_.emplace();
    ready_.emplace();
    of_body_ = upload<Index>(part.vertices, first_);
    owned_ = upload<Index>(part.own, first_);
    leaving_ = make_array<double>(9 * vertices_, first_);
    forces_back_ = make_array<double>(3 * vertices_, first_);
  }
  const DeviceGuard guard(own_.number);
  made_.emplace();
  state_ = make_array<double>(9 * vertices_, own_);
  forces_ = make_array<double>(3 * vertices_, own_);
}

void CudaCarrier::bind(std::span<const Offset> positions) {
  const Offset numbers = 3 * static_cast<Offset>(positions.size());
  {
    const DeviceGuard guard(first_.number);
    positions_ = upload(positions, first_);
    back_ = make_array<double>(numbers, first_);
  }
  const DeviceGuard guard(own_.number);
  values_ = make_array<double>(numbers, own_);
}

// The part's stream goes on when all that the first one's has so far is done.
void CudaCarrier::follow_first() {
  const DeviceGuard guard(first_.number);
  ready_->record(first_.stream.get());
  wait_for(*ready_, own_.stream.get());
}

BodyState CudaCarrier::bring(const BodyState& body) {
  const Offset numbers = 3 * vertices_;
  const double* from[3] = {body.q, body.v, body.a};
  const double* brought[3] = {};
  {
    const DeviceGuard guard(first_.number);
    for (int i = 0; i < 3; ++i) {
      if (from[i] == nullptr) continue;
      gather_kernel<<<blocks_for(numbers, kThreads), kThreads, 0, first_.stream.get()>>>(
          numbers, of_body_.data(), from[i], leaving_.data() + i * numbers);
      call("launch of the gathering of a part", [&] { return cudaGetLastError(); });
    }
  }
  follow_first();
  const DeviceGuard guard(own_.number);
  for (int i = 0; i < 3; ++i) {
    if (from[i] == nullptr) continue;
    double* const to = state_.data() + i * numbers;
    copy_between(to, own_, leaving_.data() + i * numbers, first_, numbers, own_.stream.get());
    brought[i] = to;
  }
  return {brought[0], brought[1], brought[2], true};
}

// After what the part's stream has, and in the order of landing_.
void CudaCarrier::land(double* to, const double* from, Offset count) {
  const DeviceGuard guard(own_.number);
  copy_between(to, first_, from, own_, count, own_.stream.get());
  made_->record(own_.stream.get());
  wait_for(*made_, landing_->get());
}

void CudaCarrier::take_forces(double* f) {
  land(forces_back_.data(), forces_.data(), 3 * vertices_);
  const DeviceGuard guard(first_.number);
  const Offset numbers = 3 * owned_.size();
  scatter_kernel<<<blocks_for(numbers, kThreads), kThreads, 0, landing_->get()>>>(
      numbers, owned_.data(), of_body_.data(), forces_back_.data(), f);
  call("launch of the landing of forces", [&] { return cudaGetLastError(); });
}

double* CudaCarrier::values(double* k) {
  follow_first();
  if (in_place()) return k;
  const DeviceGuard guard(own_.number);
  call("cudaMemsetAsync(tangent of a part)", [&] {
    return cudaMemsetAsync(values_.data(), 0, static_cast<std::size_t>(values_.bytes()), own_.stream.get());
  });
  return values_.data();
}

void CudaCarrier::take_values(double* k) {
  if (in_place()) return;
  land(back_.data(), values_.data(), back_.size());
  const DeviceGuard guard(first_.number);
  add_kernel<<<blocks_for(back_.size(), kThreads), kThreads, 0, landing_->get()>>>(back_.size(), positions_.data(),
                                                                                   back_.data(), k);
  call("launch of the landing of a tangent", [&] { return cudaGetLastError(); });
}

}  // namespace espalier::dynamics::cuda

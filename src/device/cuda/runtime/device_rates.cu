#include <cuda_runtime_api.h>

#include <algorithm>
#include <cstddef>
#include <map>
#include <mutex>

#include "device/cuda/runtime/device_rates.hpp"

namespace espalier::device::cuda {

namespace {

constexpr int kWarps = 8;   // of a block
constexpr int kChains = 8;  // products that do not wait for one another
constexpr int kRounds = 512;
constexpr std::size_t kBytes = std::size_t{64} << 20;

/// Every warp: kRounds x kChains products of 8 x 4 by 4 x 8.
__global__ void products(double* out) {
  double acc[kChains][2] = {};
  const double a = 1.0 + threadIdx.x * 1e-3, b = 1.0 - threadIdx.x * 1e-3;
  for (int r = 0; r < kRounds; ++r) {
#pragma unroll
    for (int c = 0; c < kChains; ++c) {
#if __CUDA_ARCH__ >= 800
      asm volatile("mma.sync.aligned.m8n8k4.row.col.f64.f64.f64.f64 {%0, %1}, {%2}, {%3}, {%0, %1};"
                   : "+d"(acc[c][0]), "+d"(acc[c][1])
                   : "d"(a), "d"(b));
#else
      for (int k = 0; k < 8; ++k) acc[c][k % 2] = fma(a, b, acc[c][k % 2]);
#endif
    }
  }
  double sum = 0;
  for (int c = 0; c < kChains; ++c) sum += acc[c][0] + acc[c][1];
  out[static_cast<std::size_t>(blockIdx.x) * blockDim.x + threadIdx.x] = sum;
}

class Measurement {
 public:
  explicit Measurement(int device) {
    (void)cudaGetDevice(&before_);
    good(cudaSetDevice(device));
    good(cudaDeviceGetAttribute(&multiprocessors_, cudaDevAttrMultiProcessorCount, device));
    good(cudaMalloc(&memory_, 2 * kBytes));
    good(cudaStreamCreateWithFlags(&stream_, cudaStreamNonBlocking));
    for (cudaEvent_t& e : events_) good(cudaEventCreate(&e));
  }
  Measurement(const Measurement&) = delete;
  Measurement& operator=(const Measurement&) = delete;
  ~Measurement() {
    for (cudaEvent_t e : events_)
      if (e != nullptr) (void)cudaEventDestroy(e);
    if (stream_ != nullptr) (void)cudaStreamDestroy(stream_);
    if (memory_ != nullptr) (void)cudaFree(memory_);
    (void)cudaGetLastError();
    (void)cudaSetDevice(before_);
  }

  DeviceRates run() {
    const int blocks = 4 * multiprocessors_;
    DeviceRates rates;
    const double product = seconds([&] {
      products<<<blocks, 32 * kWarps, 0, stream_>>>(static_cast<double*>(memory_));
      return cudaGetLastError();
    });
    rates.flops = 2.0 * 8 * 8 * 4 * kChains * kRounds * kWarps * blocks / product;
    const double copy = seconds([&] {
      return cudaMemcpyAsync(static_cast<char*>(memory_) + kBytes, memory_, kBytes, cudaMemcpyDeviceToDevice, stream_);
    });
    rates.copy_bytes = 2.0 * kBytes / copy;
    if (error_ != cudaSuccess) return {0, 0, cudaGetErrorString(error_)};
    return rates;
  }

 private:
  void good(cudaError_t e) {
    if (error_ == cudaSuccess) error_ = e;
  }
  /// The best of three, after one that does not count.
  template <class Work>
  double seconds(Work&& work) {
    float best = 1e30F;
    for (int k = 0; k < 4 && error_ == cudaSuccess; ++k) {
      float now = 0;
      good(cudaEventRecord(events_[0], stream_));
      good(work());
      good(cudaEventRecord(events_[1], stream_));
      good(cudaEventSynchronize(events_[1]));
      good(cudaEventElapsedTime(&now, events_[0], events_[1]));
      if (k > 0) best = std::min(best, now);
    }
    return 1e-3 * best;
  }

  int before_ = 0, multiprocessors_ = 1;
  void* memory_ = nullptr;
  cudaStream_t stream_ = nullptr;
  cudaEvent_t events_[2] = {nullptr, nullptr};
  cudaError_t error_ = cudaSuccess;
};

}  // namespace

DeviceRates measured_rates(int device) {
  static std::mutex mutex;
  static std::map<int, DeviceRates> known;
  const std::lock_guard lock(mutex);
  const auto found = known.find(device);
  if (found != known.end()) return found->second;
  return known[device] = Measurement(device).run();
}

}  // namespace espalier::device::cuda

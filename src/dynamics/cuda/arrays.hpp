/// \file
/// Memory of a GPU for the assembly. For this folder alone: needs the CUDA runtime.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>

#include "base/thread_pool.hpp"
#include "device/cuda/runtime/device_guard.hpp"
#include "device/cuda/runtime/device_memory.hpp"
#include "device/cuda/runtime/host_transfer.hpp"
#include "espalier/types.hpp"

namespace espalier::dynamics::cuda {

using device::cuda::call;
using device::cuda::DeviceArray;
using device::cuda::DeviceBudget;
using device::cuda::DeviceGuard;
using device::cuda::PinnedArray;

/// The GPU that all arrays of one DeviceAssembly lie on, and the order in which its work is done.
class Gpu {
 public:
  Gpu(int gpu, DeviceBudget memory, base::ThreadPool* threads) : number(gpu), budget(memory), pool(threads) {}

  static constexpr Offset kLinkBuffer = Offset{1} << 19;  // doubles that go through the link at a time: 4 MiB

  int number;
  DeviceBudget budget;
  device::cuda::Stream stream;
  base::ThreadPool* pool;  ///< null: the calling thread alone
  device::cuda::HostTransfer link{kLinkBuffer};

  /// Calls body(begin, end) for parts of 0 .. count, on several threads.
  template <class Body>
  void for_each_range(Offset count, const Body& body) const {
    constexpr std::int64_t kNumbers = 1 << 15;  // per range
    if (pool == nullptr)
      body(0, count);
    else
      pool->for_each_range(count, kNumbers, body);
  }
  /// Enqueues a copy to the GPU; `from` may change on return.
  void send(std::span<const double> from, double* to) {
    link.send(to, from.data(), static_cast<Offset>(from.size()), stream.get(), host_copy());
  }
  /// Copies from the GPU when the stream's work is done, and waits for it.
  void fetch(const double* from, std::span<double> to) {
    if (!to.empty()) link.fetch(to.data(), from, static_cast<Offset>(to.size()), stream.get(), host_copy());
  }

 private:
  [[nodiscard]] device::HostCopy host_copy() const {
    return [this](double* to, const double* from, Offset count) {
      for_each_range(count, [&](std::int64_t b, std::int64_t e) { std::copy(from + b, from + e, to + b); });
    };
  }
};

template <class T>
DeviceArray<T> make_array(Offset size, Gpu& gpu) {
  return DeviceArray<T>(size, gpu.budget, size * static_cast<Offset>(sizeof(T)));
}

/// Waits until the copy is made.
template <class T>
DeviceArray<T> upload(std::span<const T> from, Gpu& gpu) {
  DeviceArray<T> to = make_array<T>(static_cast<Offset>(from.size()), gpu);
  if (from.empty()) return to;
  call("cudaMemcpyAsync(tables)", [&] {
    return cudaMemcpyAsync(to.data(), from.data(), from.size_bytes(), cudaMemcpyHostToDevice, gpu.stream.get());
  });
  gpu.stream.wait();
  return to;
}

inline void copy(double* to, const double* from, Offset count, cudaMemcpyKind kind, const Gpu& gpu) {
  if (count == 0) return;
  call("cudaMemcpyAsync",
       [&] { return cudaMemcpyAsync(to, from, at(count) * sizeof(double), kind, gpu.stream.get()); });
}

inline unsigned blocks_for(Offset threads, int each) { return static_cast<unsigned>((threads + each - 1) / each); }

}  // namespace espalier::dynamics::cuda

/// \file
/// Owners of CUDA objects, and the check that turns a failed call into an Error.
#pragma once

#include <cuda_runtime_api.h>

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "base/memory.hpp"
#include "device/cuda/runtime/cuda_faults.hpp"
#include "espalier/types.hpp"

namespace espalier::device::cuda {

/// @throws Error(device_error) "<call>: <name> (<text>)"; Error(out_of_memory) likewise when memory was refused
inline void check(cudaError_t e, const char* call) {
  if (e == cudaSuccess) return;
  (void)cudaGetLastError();
  throw Error(e == cudaErrorMemoryAllocation ? StatusCode::out_of_memory : StatusCode::device_error,
              std::string(call) + ": " + cudaGetErrorName(e) + " (" + cudaGetErrorString(e) + ")");
}

/// Makes a call, unless a test refuses it. @returns its error
template <class Make>
cudaError_t attempt(const char* name, Make&& make) {
  if (!call_faults().refuses(name)) return make();
  return std::string(name).find("lloc") != std::string::npos ? cudaErrorMemoryAllocation : cudaErrorUnknown;
}

/// Makes a call of the CUDA runtime, or a launch. @throws as check()
template <class Make>
void call(const char* name, Make&& make) {
  check(attempt(name, make), name);
}

/// Device memory of one executor, counted against its budget.
class DeviceBudget {
 public:
  explicit DeviceBudget(Offset limit) : limit_(limit) {}
  void take(Offset bytes, Offset in_all) {
    if (held_ + bytes > limit_)
      throw Error(StatusCode::out_of_memory, "the factorization needs " + base::format_bytes(in_all) +
                                                 " of device memory, but " + base::format_bytes(limit_) +
                                                 " are available; give it more with --device-memory or use the host");
    held_ += bytes;
  }
  /// What was taken could not be had.
  void give_back(Offset bytes) { held_ -= bytes; }
  [[nodiscard]] Offset held() const { return held_; }
  [[nodiscard]] Offset left() const { return limit_ - held_; }

 private:
  Offset limit_;
  Offset held_ = 0;
};

/// An array in device memory.
template <class T>
class DeviceArray {
 public:
  DeviceArray() = default;
  DeviceArray(Offset size, DeviceBudget& budget, Offset in_all) : size_(size) {
    if (size == 0) return;
    budget.take(bytes(), in_all);
    const cudaError_t e = attempt(
        "cudaMalloc", [&] { return cudaMalloc(reinterpret_cast<void**>(&data_), static_cast<std::size_t>(bytes())); });
    if (e != cudaSuccess) budget.give_back(bytes());
    if (e == cudaErrorMemoryAllocation) {
      (void)cudaGetLastError();
      throw Error(StatusCode::out_of_memory, "the GPU refused " + base::format_bytes(bytes()) + " of its memory; " +
                                                 "others may use it: set --device-memory, or use the host");
    }
    check(e, "cudaMalloc");
  }
  DeviceArray(DeviceArray&& o) noexcept : data_(std::exchange(o.data_, nullptr)), size_(std::exchange(o.size_, 0)) {}
  DeviceArray& operator=(DeviceArray&& o) noexcept {
    std::swap(data_, o.data_);
    std::swap(size_, o.size_);
    return *this;
  }
  DeviceArray(const DeviceArray&) = delete;
  DeviceArray& operator=(const DeviceArray&) = delete;
  ~DeviceArray() {
    if (data_ != nullptr) (void)cudaFree(data_);
  }
  [[nodiscard]] T* data() const { return data_; }
  [[nodiscard]] Offset size() const { return size_; }
  [[nodiscard]] Offset bytes() const { return size_ * static_cast<Offset>(sizeof(T)); }

 private:
  T* data_ = nullptr;
  Offset size_ = 0;
};

/// At least `size` elements that fill pages of 2 MiB. In these memory goes to other processes, and what else lies in
/// one goes with it.
template <class T>
Offset whole_pages(Offset size) {
  constexpr auto kPage = static_cast<Offset>((2 << 20) / sizeof(T));
  return std::max<Offset>(1, (size + kPage - 1) / kPage) * kPage;
}

/// An array in host memory that devices see, at the same address.
template <class T>
class PinnedArray {
 public:
  PinnedArray() = default;
  explicit PinnedArray(Offset size) : size_(size) {
    if (size == 0) return;
    call("cudaHostAlloc", [&] {
      return cudaHostAlloc(reinterpret_cast<void**>(&data_), static_cast<std::size_t>(size) * sizeof(T),
                           cudaHostAllocPortable | cudaHostAllocMapped);
    });
  }
  PinnedArray(PinnedArray&& o) noexcept : data_(std::exchange(o.data_, nullptr)), size_(std::exchange(o.size_, 0)) {}
  PinnedArray& operator=(PinnedArray&& o) noexcept {
    std::swap(data_, o.data_);
    std::swap(size_, o.size_);
    return *this;
  }
  PinnedArray(const PinnedArray&) = delete;
  PinnedArray& operator=(const PinnedArray&) = delete;
  ~PinnedArray() {
    if (data_ != nullptr) (void)cudaFreeHost(data_);
  }
  [[nodiscard]] T* data() const { return data_; }
  [[nodiscard]] Offset size() const { return size_; }

 private:
  T* data_ = nullptr;
  Offset size_ = 0;
};

/// A stream, an event pair for timing, and graphs, released without throwing.
class Stream {
 public:
  Stream() {
    try {
      call("cudaStreamCreate", [&] { return cudaStreamCreateWithFlags(&stream_, cudaStreamNonBlocking); });
      call("cudaEventCreate", [&] { return cudaEventCreate(&begin_); });
      call("cudaEventCreate", [&] { return cudaEventCreate(&end_); });
    } catch (...) {
      destroy();
      throw;
    }
  }
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;
  ~Stream() { destroy(); }
  [[nodiscard]] cudaStream_t get() const { return stream_; }
  void wait() const {
    call("cudaStreamSynchronize", [&] { return cudaStreamSynchronize(stream_); });
  }
  /// Runs `work` between two events and waits. @returns seconds between them
  template <class Work>
  double timed(Work&& work) const {
    call("cudaEventRecord", [&] { return cudaEventRecord(begin_, stream_); });
    work();
    call("cudaEventRecord", [&] { return cudaEventRecord(end_, stream_); });
    call("cudaEventSynchronize", [&] { return cudaEventSynchronize(end_); });
    float milliseconds = 0;
    call("cudaEventElapsedTime", [&] { return cudaEventElapsedTime(&milliseconds, begin_, end_); });
    return 1e-3 * static_cast<double>(milliseconds);
  }

 private:
  void destroy() noexcept {
    if (begin_ != nullptr) (void)cudaEventDestroy(begin_);
    if (end_ != nullptr) (void)cudaEventDestroy(end_);
    if (stream_ != nullptr) (void)cudaStreamDestroy(stream_);
  }

  cudaStream_t stream_ = nullptr;
  cudaEvent_t begin_ = nullptr;
  cudaEvent_t end_ = nullptr;
};

/// A stream of others. One that is done, as after every call of a caller that waits itself, costs one question.
inline void wait_for_stream(cudaStream_t theirs) {
  const cudaError_t state = attempt("cudaStreamQuery(caller's stream)", [&] { return cudaStreamQuery(theirs); });
  if (state == cudaErrorNotReady)
    call("cudaStreamSynchronize(caller's stream)", [&] { return cudaStreamSynchronize(theirs); });
  else
    check(state, "cudaStreamQuery(caller's stream)");
}

/// A point in a stream's work, for waiting.
class Event {
 public:
  Event() {
    call("cudaEventCreate", [&] { return cudaEventCreateWithFlags(&event_, cudaEventDisableTiming); });
  }
  Event(const Event&) = delete;
  Event& operator=(const Event&) = delete;
  ~Event() {
    if (event_ != nullptr) (void)cudaEventDestroy(event_);
  }
  void record(cudaStream_t stream) const {
    call("cudaEventRecord", [&] { return cudaEventRecord(event_, stream); });
  }
  void wait() const {
    call("cudaEventSynchronize", [&] { return cudaEventSynchronize(event_); });
  }
  [[nodiscard]] cudaEvent_t get() const { return event_; }

 private:
  cudaEvent_t event_ = nullptr;
};

class Graph {
 public:
  Graph() = default;
  Graph(Graph&& o) noexcept : exec_(std::exchange(o.exec_, nullptr)) {}
  Graph& operator=(Graph&& o) noexcept {
    std::swap(exec_, o.exec_);
    return *this;
  }
  Graph(const Graph&) = delete;
  Graph& operator=(const Graph&) = delete;
  ~Graph() {
    if (exec_ != nullptr) (void)cudaGraphExecDestroy(exec_);
  }
  /// Records what `work` enqueues on the stream.
  template <class Work>
  static Graph record(cudaStream_t stream, Work&& work) {
    call("cudaStreamBeginCapture", [&] { return cudaStreamBeginCapture(stream, cudaStreamCaptureModeThreadLocal); });
    cudaGraph_t graph = nullptr;
    try {
      work();
      call("cudaStreamEndCapture", [&] { return cudaStreamEndCapture(stream, &graph); });
    } catch (...) {
      (void)cudaStreamEndCapture(stream, &graph);  // else the stream would go on recording
      (void)cudaGetLastError();
      if (graph != nullptr) (void)cudaGraphDestroy(graph);
      throw;
    }
    Graph g;
    const auto e = attempt("cudaGraphInstantiate", [&] { return cudaGraphInstantiate(&g.exec_, graph, 0); });
    (void)cudaGraphDestroy(graph);
    check(e, "cudaGraphInstantiate");
    return g;
  }
  [[nodiscard]] bool recorded() const { return exec_ != nullptr; }
  void launch(cudaStream_t stream) const {
    call("cudaGraphLaunch", [&] { return cudaGraphLaunch(exec_, stream); });
  }

 private:
  cudaGraphExec_t exec_ = nullptr;
};

}  // namespace espalier::device::cuda

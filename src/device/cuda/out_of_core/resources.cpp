#include "device/cuda/out_of_core/resources.hpp"

#include <string>

#include "device/cuda/runtime/device_memory.hpp"

namespace espalier::device::cuda {

Resources::~Resources() {
  (void)cudaSetDevice(options_.device);
  for (cudaStream_t s : streams_)
    if (s != nullptr) (void)cudaStreamSynchronize(s);
  for (auto* lists : {&marks_, &starts_})
    for (auto& list : *lists)
      for (cudaEvent_t e : list) (void)cudaEventDestroy(e);
  for (cudaEvent_t e : slots_) (void)cudaEventDestroy(e);
  for (cudaStream_t s : streams_)
    if (s != nullptr) (void)cudaStreamDestroy(s);
  if (arena_ != nullptr) (void)cudaFree(arena_);
  if (ring_ != nullptr) (void)cudaFreeHost(ring_);
}

void Resources::take(Offset arena_bytes, int slots, Offset slot_bytes,
                     const std::array<std::size_t, out_of_core::kQueues>& marks) {
  const auto size = [](Offset bytes) { return static_cast<std::size_t>(bytes); };
  call("cudaSetDevice", [&] { return cudaSetDevice(options_.device); });
  slot_bytes_ = slot_bytes;
  arena_bytes_ = arena_bytes;
  allocate("cudaMalloc", [&] { return cudaMalloc(reinterpret_cast<void**>(&arena_), size(arena_bytes)); });
  allocate("cudaHostAlloc", [&] {
    return cudaHostAlloc(reinterpret_cast<void**>(&ring_), size(slots * slot_bytes), cudaHostAllocDefault);
  });
  for (cudaStream_t& s : streams_)
    call("cudaStreamCreate", [&] { return cudaStreamCreateWithFlags(&s, cudaStreamNonBlocking); });
  for (std::size_t q = 0; q < marks.size(); ++q) {
    const bool timed = q == static_cast<std::size_t>(out_of_core::Queue::run) ||
                       q == static_cast<std::size_t>(out_of_core::Queue::second_run);
    make_events(marks_[q], marks[q], timed ? cudaEventDefault : cudaEventDisableTiming);
    if (timed) make_events(starts_[q], marks[q], cudaEventDefault);
  }
  make_events(slots_, static_cast<std::size_t>(slots), cudaEventDisableTiming);
}

bool Resources::reads_pinned_memory() const {
  int value = 0;
  call("cudaDeviceGetAttribute",
       [&] { return cudaDeviceGetAttribute(&value, cudaDevAttrCanUseHostPointerForRegisteredMem, options_.device); });
  return value != 0;
}

template <class Make>
void Resources::allocate(const char* name, Make&& make) {
  const cudaError_t e = attempt(name, make);
  if (e == cudaSuccess) return;
  (void)cudaGetLastError();
  const std::string text = std::string(name) + ": " + cudaGetErrorName(e) + " (" + cudaGetErrorString(e) + ")";
  if (e == cudaErrorMemoryAllocation) throw out_of_core::AllocationRefused(text);
  throw Error(StatusCode::device_error, text);
}

void Resources::make_events(std::vector<cudaEvent_t>& list, std::size_t count, unsigned flags) {
  for (std::size_t k = 0; k < count; ++k) {
    cudaEvent_t e = nullptr;
    call("cudaEventCreate", [&] { return cudaEventCreateWithFlags(&e, flags); });
    list.push_back(e);
  }
}

Offset free_device_bytes(int device) {
  int before = 0;
  call("cudaGetDevice", [&] { return cudaGetDevice(&before); });
  call("cudaSetDevice", [&] { return cudaSetDevice(device); });
  std::size_t free = 0, total = 0;
  const auto e = attempt("cudaMemGetInfo", [&] { return cudaMemGetInfo(&free, &total); });
  (void)cudaSetDevice(before);
  check(e, "cudaMemGetInfo");
  constexpr Offset kReserve = 64 << 20;  // kernels' stacks and the driver's own
  return std::max<Offset>(0, static_cast<Offset>(free) - kReserve);
}

}  // namespace espalier::device::cuda

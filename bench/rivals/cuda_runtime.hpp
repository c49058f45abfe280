/// \file
/// What the rivals use of the CUDA runtime, loaded at run time: neither header nor library is needed to build.
#pragma once

#include <cstddef>
#include <string>

#include "rivals/rival.hpp"
#include "rivals/shared_library.hpp"

namespace espalier::bench {

constexpr int kMemcpyHostToDevice = 1, kMemcpyDeviceToHost = 2;  ///< cudaMemcpyKind

/// The CUDA runtime, loaded at run time. Functions return 0 on success.
struct Cuda {
  SharedLibrary library{{"libcudart.so.13", "libcudart.so.12", "libcudart.so"}, SharedLibrary::Scope::global};
  int (*get_device_count)(int*) = library.function<int (*)(int*)>("cudaGetDeviceCount");
  int (*set_device)(int) = library.function<int (*)(int)>("cudaSetDevice");
  int (*malloc)(void**, std::size_t) = library.function<int (*)(void**, std::size_t)>("cudaMalloc");
  int (*free)(void*) = library.function<int (*)(void*)>("cudaFree");
  int (*memcpy)(void*, const void*, std::size_t,
                int) = library.function<int (*)(void*, const void*, std::size_t, int)>("cudaMemcpy");
  int (*synchronize)() = library.function<int (*)()>("cudaDeviceSynchronize");
  const char* (*error_string)(int) = library.function<const char* (*)(int)>("cudaGetErrorString");
};

/// A failed CUDA call as a failure that names the call.
inline void check_cuda(const Cuda& cuda, int error, const char* call) {
  constexpr int kMemoryAllocation = 2;  // cudaErrorMemoryAllocation
  if (error == 0) return;
  throw Failure(error == kMemoryAllocation ? Outcome::out_of_memory : Outcome::failed,
                std::string("CUDA ") + call + ": " + cuda.error_string(error));
}

/// An array in the memory of the device that is current.
template <typename T>
class DeviceArray {
 public:
  DeviceArray(const Cuda& cuda, std::size_t size) : cuda_(cuda), bytes_(size * sizeof(T)) {
    check_cuda(cuda_, cuda_.malloc(&data_, bytes_), "cudaMalloc");
  }
  DeviceArray(const DeviceArray&) = delete;
  DeviceArray& operator=(const DeviceArray&) = delete;
  ~DeviceArray() { cuda_.free(data_); }
  void upload(const T* from) {
    check_cuda(cuda_, cuda_.memcpy(data_, from, bytes_, kMemcpyHostToDevice), "cudaMemcpy");
  }
  void download(T* to) const { check_cuda(cuda_, cuda_.memcpy(to, data_, bytes_, kMemcpyDeviceToHost), "cudaMemcpy"); }
  void* get() { return data_; }

 private:
  const Cuda& cuda_;
  void* data_ = nullptr;
  std::size_t bytes_;
};

}  // namespace espalier::bench

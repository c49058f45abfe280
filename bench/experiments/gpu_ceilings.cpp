/// \file
/// Ceilings of GPUs through the driver's own interface, loaded at run time: no CUDA is needed to build this, and the
/// same binary measures wherever a driver is found.
#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <nlohmann/json.hpp>
#include <vector>

#include "base/timeline.hpp"
#include "experiments/ceilings.hpp"
#include "rivals/rival.hpp"
#include "rivals/shared_library.hpp"

namespace espalier::bench {
namespace {

using DevicePointer = unsigned long long;
using Context = void*;

/// The functions of libcuda that are used here; every one returns 0 for success.
struct Driver {
  SharedLibrary library{{"libcuda.so.1"}, SharedLibrary::Scope::local};
  int (*init)(unsigned) = library.function<int (*)(unsigned)>("cuInit");
  int (*count)(int*) = library.function<int (*)(int*)>("cuDeviceGetCount");
  int (*name)(char*, int, int) = library.function<int (*)(char*, int, int)>("cuDeviceGetName");
  int (*attribute)(int*, int, int) = library.function<int (*)(int*, int, int)>("cuDeviceGetAttribute");
  int (*retain)(Context*, int) = library.function<int (*)(Context*, int)>("cuDevicePrimaryCtxRetain");
  int (*release)(int) = library.function<int (*)(int)>("cuDevicePrimaryCtxRelease_v2");
  int (*set_current)(Context) = library.function<int (*)(Context)>("cuCtxSetCurrent");
  int (*synchronize)() = library.function<int (*)()>("cuCtxSynchronize");
  int (*allocate)(DevicePointer*,
                  std::size_t) = library.function<int (*)(DevicePointer*, std::size_t)>("cuMemAlloc_v2");
  int (*free)(DevicePointer) = library.function<int (*)(DevicePointer)>("cuMemFree_v2");
  int (*set)(DevicePointer, unsigned char,
             std::size_t) = library.function<int (*)(DevicePointer, unsigned char, std::size_t)>("cuMemsetD8_v2");
  int (*allocate_host)(void**, std::size_t) = library.function<int (*)(void**, std::size_t)>("cuMemAllocHost_v2");
  int (*free_host)(void*) = library.function<int (*)(void*)>("cuMemFreeHost");
  int (*to_device)(DevicePointer, const void*,
                   std::size_t) = library.function<int (*)(DevicePointer, const void*, std::size_t)>("cuMemcpyHtoD_v2");
  int (*to_host)(void*, DevicePointer,
                 std::size_t) = library.function<int (*)(void*, DevicePointer, std::size_t)>("cuMemcpyDtoH_v2");
  int (*on_device)(DevicePointer, DevicePointer, std::size_t) =
      library.function<int (*)(DevicePointer, DevicePointer, std::size_t)>("cuMemcpyDtoD_v2");
  int (*to_peer)(DevicePointer, Context, DevicePointer, Context, std::size_t) =
      library.function<int (*)(DevicePointer, Context, DevicePointer, Context, std::size_t)>("cuMemcpyPeer");
  int (*enable_peer)(Context, unsigned) = library.function<int (*)(Context, unsigned)>("cuCtxEnablePeerAccess");
};

void check(int error, const char* call) {
  if (error != 0) throw Failure(Outcome::failed, fmt::format("{} returned {}", call, error));
}

/// Best of the units per second that `body` makes.
double best_rate(double units, double seconds, const std::function<void()>& body) {
  body();
  double best = 0;
  const double end = base::now_seconds() + seconds;
  for (int k = 0; k < 3 || base::now_seconds() < end; ++k) {
    const double start = base::now_seconds();
    body();
    best = std::max(best, units / (base::now_seconds() - start));
  }
  return best;
}

/// One GPU with its primary context, current while this object is used.
class Gpu {
 public:
  Gpu(const Driver& driver, int number) : driver_(driver), number_(number) {
    check(driver_.retain(&context_, number), "cuDevicePrimaryCtxRetain");
  }
  Gpu(const Gpu&) = delete;
  Gpu& operator=(const Gpu&) = delete;
  ~Gpu() {
    driver_.set_current(context_);
    for (const DevicePointer p : held_) driver_.free(p);
    driver_.release(number_);
  }
  void use() const { check(driver_.set_current(context_), "cuCtxSetCurrent"); }
  DevicePointer take(std::size_t bytes) {
    use();
    DevicePointer p = 0;
    check(driver_.allocate(&p, bytes), "cuMemAlloc");
    held_.push_back(p);
    check(driver_.set(p, 0, bytes), "cuMemsetD8");
    return p;
  }
  void give_back() {
    use();
    for (const DevicePointer p : held_) driver_.free(p);
    held_.clear();
  }
  [[nodiscard]] Context context() const { return context_; }
  [[nodiscard]] int number() const { return number_; }

 private:
  const Driver& driver_;
  int number_;
  Context context_ = nullptr;
  std::vector<DevicePointer> held_;
};

constexpr std::size_t kCopy = std::size_t{256} << 20;    // bytes of a copy over a link
constexpr std::size_t kOnDevice = std::size_t{1} << 30;  // bytes of a copy inside a device's memory

nlohmann::json copies(const Driver& driver, Gpu& gpu, double seconds) {
  const DevicePointer a = gpu.take(kOnDevice), b = gpu.take(kOnDevice);
  void* host = nullptr;
  check(driver.allocate_host(&host, kCopy), "cuMemAllocHost");
  const auto rate = [&](double bytes, const std::function<int()>& copy) {
    return best_rate(bytes, seconds, [&] {
      check(copy(), "copy");
      check(driver.synchronize(), "cuCtxSynchronize");
    });
  };
  nlohmann::json record = {
      {"host_to_device_bytes_per_second", rate(kCopy, [&] { return driver.to_device(a, host, kCopy); })},
      {"device_to_host_bytes_per_second", rate(kCopy, [&] { return driver.to_host(host, a, kCopy); })},
      // Read and written: twice the bytes of the copy.
      {"memory_bytes_per_second", rate(2.0 * kOnDevice, [&] { return driver.on_device(b, a, kOnDevice); })}};
  driver.free_host(host);
  gpu.give_back();
  return record;
}

/// Matrix product of cuBLAS in FP64, 8,192 rows and columns. Throws Failure where there is no cuBLAS.
double product_rate(const Driver& driver, Gpu& gpu, double seconds) {
  using Handle = void*;
  constexpr int n = 8192;
  const SharedLibrary cublas({"libcublas.so.13", "libcublas.so.12", "libcublas.so"}, SharedLibrary::Scope::local);
  const auto create = cublas.function<int (*)(Handle*)>("cublasCreate_v2");
  const auto destroy = cublas.function<int (*)(Handle)>("cublasDestroy_v2");
  const auto gemm = cublas.function<int (*)(Handle, int, int, int, int, int, const double*, const double*, int,
                                            const double*, int, const double*, double*, int)>("cublasDgemm_v2");
  const std::size_t bytes = std::size_t{n} * n * sizeof(double);
  const auto array = [&] { return reinterpret_cast<double*>(gpu.take(bytes)); };
  double *a = array(), *b = array(), *c = array();
  Handle handle = nullptr;
  check(create(&handle), "cublasCreate");
  const double one = 1, zero = 0;
  const double rate = best_rate(2.0 * n * n * n, seconds, [&] {
    check(gemm(handle, 0, 1, n, n, n, &one, a, n, b, n, &zero, c, n), "cublasDgemm");
    check(driver.synchronize(), "cuCtxSynchronize");
  });
  destroy(handle);
  gpu.give_back();
  return rate;
}

/// Peak of the FP64 tensor pipe (CUDA cores where there is none) by data sheet: operations per clock and multiprocessor
/// by compute capability, times multiprocessors and boost clock. 0 where it is not known.
double data_sheet_rate(const Driver& driver, int gpu) {
  constexpr int kClock = 13, kProcessors = 16, kMajor = 75, kMinor = 76;  // CUdevice_attribute of cuda.h; clock in kHz
  int clock = 0, processors = 0, major = 0, minor = 0;
  driver.attribute(&clock, kClock, gpu);
  driver.attribute(&processors, kProcessors, gpu);
  driver.attribute(&major, kMajor, gpu);
  driver.attribute(&minor, kMinor, gpu);
  double per_clock = 0;
  if (major == 8 && minor == 0) per_clock = 128;  // A100: 19.5 TFLOP/s at 108 x 1.41 GHz
  if (major == 9) per_clock = 256;                // H100, H200: 66.9 TFLOP/s at 132 x 1.98 GHz
  return per_clock * processors * clock * 1e3;
}

nlohmann::json one_gpu(const Driver& driver, Gpu& gpu, double seconds) {
  gpu.use();
  char name[256] = "";
  driver.name(name, sizeof name, gpu.number());
  nlohmann::json record = {{"name", name}, {"gemm_flops_per_second", nullptr}};
  record.update(copies(driver, gpu, seconds));
  const double sheet = data_sheet_rate(driver, gpu.number());
  record["data_sheet_flops_per_second"] = sheet > 0 ? nlohmann::json(sheet) : nlohmann::json(nullptr);
  try {
    record["gemm_flops_per_second"] = product_rate(driver, gpu, seconds);
  } catch (const Failure& failure) {
    record["reason"] = failure.what();
  }
  return record;
}

/// The link from `from` to every other GPU, bytes per second; null where the copy failed.
nlohmann::json links(const Driver& driver, std::vector<std::unique_ptr<Gpu>>& gpus, std::size_t from, double seconds) {
  nlohmann::json record = nlohmann::json::array();
  for (std::size_t to = 0; to < gpus.size(); ++to) {
    record.push_back(nullptr);
    if (to == from) continue;
    try {
      const DevicePointer b = gpus[to]->take(kCopy), a = gpus[from]->take(kCopy);
      (void)driver.enable_peer(gpus[to]->context(), 0);  // without it the copy goes through the host: that is the link
      record.back() = best_rate(kCopy, seconds, [&] {
        check(driver.to_peer(b, gpus[to]->context(), a, gpus[from]->context(), kCopy), "cuMemcpyPeer");
        check(driver.synchronize(), "cuCtxSynchronize");
      });
    } catch (const Failure&) {
      record.back() = nullptr;
    }
    gpus[to]->give_back();
    gpus[from]->give_back();
  }
  return record;
}

}  // namespace

nlohmann::json measure_gpu_ceilings(double seconds) {
  nlohmann::json records = nlohmann::json::array();
  try {
    const Driver driver;
    int count = 0;
    if (driver.init(0) != 0 || driver.count(&count) != 0) return records;
    std::vector<std::unique_ptr<Gpu>> gpus;
    for (int k = 0; k < count; ++k) gpus.push_back(std::make_unique<Gpu>(driver, k));
    for (auto& gpu : gpus) records.push_back(one_gpu(driver, *gpu, seconds));
    for (std::size_t k = 0; count > 1 && k < gpus.size(); ++k)
      records[k]["to_peers_bytes_per_second"] = links(driver, gpus, k, seconds);
  } catch (const Failure&) {
    // No driver, or one that fails: what was measured so far.
  }
  return records;
}

}  // namespace espalier::bench

#include "solver/device_choice.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>

#include "analysis/plan.hpp"
#include "device/cuda/cuda_executor.hpp"

namespace espalier::solver {

namespace {

// Cost models, from refactorizations on 2 and 16 AVX-512 cores and on one H200 (docs/performance.md, "cost model").
constexpr double kHostFlopsPerSecond = 6e10;  // per thread
constexpr double kHostSecondsPerFront = 1.5e-6;
constexpr double kGpuFlopsPerSecond = 2.5e13;
constexpr double kGpuBytesPerSecond = 1.5e12;  // factor entries, written and read
constexpr double kGpuSecondsPerTier = 2e-5;    // a chain of fronts cannot be shortened by width
constexpr double kGpuStartSeconds = 2e-4;      // values to the device, launch, outcome back

constexpr std::int64_t kMostThreads = 4096;

DeviceChoice cuda_device(int gpu, std::string reason) {
  const device::cuda::Availability found = device::cuda::available_devices();
  if (found.devices.empty()) throw Error(StatusCode::device_error, "no GPU can be used: " + found.reason);
  if (gpu < 0 || gpu >= static_cast<int>(found.devices.size()))
    throw Error(StatusCode::device_error,
                fmt::format("GPU {} was asked for, but this machine has {}", gpu, found.devices.size()));
  return {DeviceChoice::Backend::cuda, gpu, 1, std::move(reason)};
}

DeviceChoice automatic(const PredictedTime& t) {
  const device::cuda::Availability found = device::cuda::available_devices();
  if (found.devices.empty()) return {DeviceChoice::Backend::host, 0, 1, "host: " + found.reason};
  const std::string figures =
      fmt::format("predicted {:.2g} s on the GPU, {:.2g} s on the host", t.gpu_seconds, t.host_seconds);
  if (t.gpu_seconds < t.host_seconds) return {DeviceChoice::Backend::cuda, 0, 1, "GPU: " + figures};
  return {DeviceChoice::Backend::host, 0, 1, "host: " + figures};
}

}  // namespace

std::optional<HostDevices> host_devices(const std::string& device, int threads) {
  if (!device.starts_with("host:")) return std::nullopt;
  HostDevices host;
  const char* end = device.data() + device.size();
  auto [stop, error] = std::from_chars(device.data() + 5, end, host.devices);
  if (error != std::errc() || host.devices < 1) return std::nullopt;
  host.threads = std::max(1, threads / host.devices);
  if (stop != end) {
    if (*stop != ',') return std::nullopt;
    const auto [last, second_error] = std::from_chars(stop + 1, end, host.threads);
    if (second_error != std::errc() || last != end || host.threads < 1) return std::nullopt;
  }
  if (std::int64_t{host.devices} * host.threads > kMostThreads) return std::nullopt;
  return host;
}

PredictedTime predict_time(const analysis::AssemblyTree& tree, Kind kind, bool single, int threads) {
  PredictedTime t;
  double entries = 0;
  std::vector<Index> tier(static_cast<std::size_t>(tree.fronts()), 0);
  Index tiers = 0;
  for (Index f = tree.fronts() - 1; f >= 0; --f) {
    const double k = tree.pivots(f);
    const double m = k + tree.rows_below(f);
    t.flops += analysis::front_flops(tree.pivots(f), tree.pivots(f) + tree.rows_below(f), kind == Kind::lu);
    entries += k * m * (kind == Kind::lu ? 2 : 1);
    if (tree.parent[f] >= 0) tier[f] = tier[tree.parent[f]] + 1;
    tiers = std::max(tiers, tier[f] + 1);
  }
  const double precision = single ? 2 : 1;
  t.host_seconds =
      t.flops / (kHostFlopsPerSecond * precision * threads) + kHostSecondsPerFront * tree.fronts() / threads;
  t.gpu_seconds = kGpuStartSeconds + kGpuSecondsPerTier * tiers + t.flops / kGpuFlopsPerSecond +
                  entries * 16 / (kGpuBytesPerSecond * precision);
  return t;
}

DeviceChoice choose_device(const Options& options, const PredictedTime& predicted) {
  const std::string& text = options.device;
  if (text == "auto") return automatic(predicted);
  if (text == "cpu") return {DeviceChoice::Backend::host, 0, 1, "host: asked for"};
  if (const auto host = host_devices(text, 1))
    return {DeviceChoice::Backend::host, 0, host->devices,
            fmt::format("{} host device{}: asked for", host->devices, host->devices == 1 ? "" : "s")};
  if (text == "gpu") return cuda_device(0, "GPU: asked for");
  if (text.starts_with("gpu:")) {
    int gpu = 0;
    const char* end = text.data() + text.size();
    const auto [stop, error] = std::from_chars(text.data() + 4, end, gpu);
    if (error == std::errc() && stop == end) return cuda_device(gpu, "GPU: asked for");
  }
  throw Error(StatusCode::invalid_input,
              fmt::format("device '{}' is not known; use auto, cpu, host:N, host:N,M or gpu:0", text));
}

}  // namespace espalier::solver

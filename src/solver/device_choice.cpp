#include "solver/device_choice.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "device/cuda/executor/cuda_executor.hpp"
#include "plan/plan.hpp"
#include "solver/option_check.hpp"

namespace espalier::solver {

namespace {

constexpr double kGainOfDevice = 0.9;  // another GPU must bring the predicted time below this part of it

DeviceChoice on_gpus(const device::cuda::Availability& found, std::vector<int> gpus, std::string reason) {
  const auto count = static_cast<int>(gpus.size());
  const auto& names = found.devices;
  const std::string& first = names[static_cast<std::size_t>(gpus.front())].name;
  const bool unequal = std::any_of(gpus.begin(), gpus.end(),
                                   [&](int gpu) { return names[static_cast<std::size_t>(gpu)].name != first; });
  return {DeviceChoice::Backend::cuda, std::move(gpus), count, std::move(reason), true, unequal};
}
DeviceChoice on_host(int devices, std::string reason) {
  return {DeviceChoice::Backend::host, {}, devices, std::move(reason), false};
}

// The GPUs that were asked for by number; none: all.
DeviceChoice asked_for(std::vector<int> gpus) {
  const device::cuda::Availability found = device::cuda::available_devices();
  if (found.devices.empty()) throw Error(StatusCode::device_error, "no GPU can be used: " + found.reason);
  const auto count = static_cast<int>(found.devices.size());
  if (gpus.empty())
    for (int d = 0; d < std::min(count, device::cuda::kMostDevices); ++d) gpus.push_back(d);
  for (const int gpu : gpus)
    if (gpu < 0 || gpu >= count)
      throw Error(StatusCode::device_error, fmt::format("GPU {} was asked for, but this machine has {}", gpu, count));
  std::string reason = gpus.size() == 1 ? "GPU: asked for" : fmt::format("{} GPUs: asked for", gpus.size());
  return on_gpus(found, std::move(gpus), std::move(reason));
}

// "0" or "0,1,2": every number once, at most device::cuda::kMostDevices of them.
std::optional<std::vector<int>> gpu_list(const std::string& text) {
  std::vector<int> gpus;
  const char* at = text.data();
  const char* const end = at + text.size();
  for (;;) {
    int gpu = 0;
    const auto [stop, error] = std::from_chars(at, end, gpu);
    if (error != std::errc() || gpu < 0 || std::find(gpus.begin(), gpus.end(), gpu) != gpus.end()) return std::nullopt;
    gpus.push_back(gpu);
    if (static_cast<int>(gpus.size()) > device::cuda::kMostDevices) return std::nullopt;
    if (stop == end) return gpus;
    if (*stop != ',') return std::nullopt;
    at = stop + 1;
  }
}

DeviceChoice automatic(const PredictedTime& t, std::size_t budgets) {
  const device::cuda::Availability found = device::cuda::available_devices();
  if (found.devices.empty()) return on_host(1, "host: " + found.reason);
  int most = std::min(static_cast<int>(found.devices.size()), device::cuda::kMostDevices);
  if (budgets > 0) most = std::min(most, static_cast<int>(budgets));
  const int count = fastest_count(t.gpu, most);
  const std::string figures = fmt::format("predicted {:.2g} s on {} of {} GPU{}, {:.2g} s on the host",
                                          t.gpu_seconds_on(count), count, most, most == 1 ? "" : "s", t.host_seconds);
  if (t.gpu_seconds_on(count) >= t.host_seconds) return on_host(1, "host: " + figures);
  std::vector<int> gpus;
  for (int d = 0; d < count; ++d) gpus.push_back(d);
  return on_gpus(found, std::move(gpus), "GPU: " + figures);
}

}  // namespace

int fastest_count(const plan::GpuTime& time, int most) {
  int best = 1;
  for (int count = 2; count <= most; ++count)
    if (time.on(count) < kGainOfDevice * time.on(best)) best = count;
  return best;
}

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

PredictedTime predict_time(const analysis::AssemblyTree& tree, Kind kind, bool single, int threads,
                           const plan::Machine& machine) {
  PredictedTime t;
  t.host_seconds = plan::host_seconds(tree, kind, single, threads, machine.host);
  t.gpu = plan::gpu_time(tree, kind, single, machine.gpu);
  t.gpu_seconds = machine.gpu.start + t.gpu.on(1);
  return t;
}

namespace {

DeviceChoice choose(const Options& options, const PredictedTime& predicted) {
  const std::string& text = options.device;
  if (text == "auto") return automatic(predicted, options.device_memory_each_bytes.size());
  if (text == "cpu") return on_host(1, "host: asked for");
  if (const auto host = host_devices(text, 1)) {
    DeviceChoice choice = on_host(
        host->devices, fmt::format("{} host device{}: asked for", host->devices, host->devices == 1 ? "" : "s"));
    choice.budgeted = true;
    return choice;
  }
  if (text == "gpu:all") return asked_for({});
  if (text.starts_with("gpu:"))
    if (auto gpus = gpu_list(text.substr(4))) return asked_for(std::move(*gpus));
  throw Error(StatusCode::invalid_input, fmt::format("device '{}' is not known; use {}", text, kDeviceTexts));
}

}  // namespace

bool is_device(const std::string& text) {
  if (text == "auto" || text == "cpu" || text == "gpu:all" || host_devices(text, 1)) return true;
  return text.starts_with("gpu:") && gpu_list(text.substr(4));
}

DeviceChoice leave_out(DeviceChoice choice, const std::vector<device::cuda::DeviceRates>& rates) {
  constexpr double kSlow = 0.25;  // a GPU below this part of the fastest makes its blocks of the top too late for all
  constexpr double kSteps = 8;
  double best = 0, copy = 0;
  for (const auto& r : rates) {
    if (!r.refused.empty()) continue;
    best = std::max(best, r.flops);
    copy = std::max(copy, r.copy_bytes);
  }
  DeviceChoice kept = choice;
  kept.gpus.clear();
  for (std::size_t k = 0; k < rates.size(); ++k) {
    const double speed = best > 0 ? rates[k].flops / best : 0;
    const bool refused = !rates[k].refused.empty();
    if (refused || speed < kSlow) {
      kept.notice += fmt::format(
          "{}GPU {} is left out: {}", kept.notice.empty() ? "" : "; ", choice.gpus[k],
          refused ? rates[k].refused : fmt::format("it has {:.0f} % of the speed of the fastest", 100 * speed));
      continue;
    }
    kept.gpus.push_back(choice.gpus[k]);
    kept.places.push_back(k);
    kept.speed.push_back(std::round(kSteps * speed) / kSteps);
  }
  kept.reason += fmt::format("; measured {:.1f} TFLOP/s and {:.1f} TB/s on the fastest", 1e-12 * best, 1e-12 * copy);
  if (kept.gpus.empty()) throw Error(StatusCode::device_error, "no GPU can be used: " + kept.notice);
  kept.devices = static_cast<int>(kept.gpus.size());
  if (std::all_of(kept.speed.begin(), kept.speed.end(), [](double s) { return s == 1; }))
    kept.speed.clear();
  else
    kept.unequal = true;
  return kept;
}

std::vector<int> named_gpus(const std::string& device) {
  Options options;
  options.device = device;
  try {
    return choose(options, {}).gpus;
  } catch (const Error&) {
    return {};
  }
}

DeviceChoice choose_device(const Options& options, const PredictedTime& predicted) {
  DeviceChoice choice = choose(options, predicted);
  const auto budgets = static_cast<int>(options.device_memory_each_bytes.size());
  if (budgets > 0 && choice.budgeted && budgets != choice.devices && options.device != "auto")
    throw Error(StatusCode::invalid_input,
                fmt::format("{} budgets of device memory for {} device{}: give one for all, or one for each", budgets,
                            choice.devices, choice.devices == 1 ? "" : "s"));
  if (choice.backend == DeviceChoice::Backend::host || choice.devices == 1) return choice;
  device::cuda::open_devices(choice.gpus);
  std::vector<device::cuda::DeviceRates> rates;
  for (const int gpu : choice.gpus) rates.push_back(device::cuda::measured_rates(gpu));
  return leave_out(std::move(choice), rates);
}

}  // namespace espalier::solver

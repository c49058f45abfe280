/// \file
/// Which device carries out a plan: the caller's wish, or the one that the cost model predicts to be fastest.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "device/cuda/runtime/device_rates.hpp"
#include "espalier/solver.hpp"
#include "plan/front_cost.hpp"

namespace espalier::solver {

struct DeviceChoice {
  enum class Backend { host, cuda };
  Backend backend = Backend::host;
  std::vector<int> gpus = {};            ///< numbers of the GPUs (cuda)
  int devices = 1;                       ///< GPUs or host devices that share the plan
  std::string reason;                    ///< one sentence for the report
  bool budgeted = true;                  ///< Options::device_memory_bytes is meant for this device
  bool unequal = false;                  ///< the GPUs are not all of one kind, or not equally fast
  std::vector<double> speed = {};        ///< of the GPUs, relative to the fastest; empty: all are equal
  std::vector<std::size_t> places = {};  ///< of the GPUs among those asked for; empty: all are there
  std::string notice = {};               ///< which GPUs were left out, and why
};

/// Those of several GPUs that are of use: they can be started and are not so slow that the others would wait for them.
/// Speeds are rounded to eighths of the fastest, so that equal GPUs get equal parts in every run.
/// @param rates  of `gpus`, measured
/// @throws Error(device_error) when none is left
DeviceChoice leave_out(DeviceChoice choice, const std::vector<device::cuda::DeviceRates>& rates);

/// N devices of M threads each.
struct HostDevices {
  int devices = 1;
  int threads = 1;
};
/// Reads "host:N" or "host:N,M". Without M, a device has an even part of `threads`, at least one; N M threads in all.
/// Empty for a text that is neither, or more than 4,096 threads.
std::optional<HostDevices> host_devices(const std::string& device, int threads);

/// The seconds of a factorization that the machine models predict from its assembly tree.
struct PredictedTime {
  double host_seconds = 0;
  double gpu_seconds = 0;  ///< on one
  plan::GpuTime gpu;       ///< without what it takes to bring values there and the outcome back

  [[nodiscard]] double gpu_seconds_on(int devices) const { return gpu_seconds - gpu.on(1) + gpu.on(devices); }
};
PredictedTime predict_time(const analysis::AssemblyTree& tree, Kind kind, bool single, int threads,
                           const plan::Machine& machine);

/// The number of GPUs, at most `most`, that are predicted to be fastest; fewer where more would gain next to nothing.
int fastest_count(const plan::GpuTime& time, int most);

/// What Options::device may be, for messages; and whether a text is one of them. Whether a GPU is there is not looked
/// at.
inline constexpr const char* kDeviceTexts =
    "auto, cpu, host:N, host:N,M (threads per host device; 4096 in all), gpu:all or gpu:0,1 (each once)";
bool is_device(const std::string& text);

/// The GPUs that Options::device names, without a look at what they can do; none where it names none, or one that is
/// not there.
std::vector<int> named_gpus(const std::string& device);

/// Reads options.device: auto | cpu | host:N | host:N,M | gpu:all | gpu:0,1. auto takes as many GPUs as the model says
/// are fastest.
/// @throws Error(invalid_input) for a text that is none of these; Error(device_error) for a GPU that is not there, with
///         the reason
DeviceChoice choose_device(const Options& options, const PredictedTime& predicted);

}  // namespace espalier::solver

/// \file
/// What espalier_gpu_check is asked for.
#pragma once

#include <string>
#include <vector>

#include "device/cuda/executor/cuda_executor.hpp"
#include "gpu/gpu_document.hpp"

namespace espalier::bench {

struct CheckSettings {
  GpuOptions common;
  bool host = false;   ///< compare with the host executor
  bool lists = false;  ///< with --plan: every device's list
  Index columns = 1;
  std::vector<int> devices = {0};  ///< GPUs
  std::vector<int> counts;         ///< so many of them in turn; empty: all
  std::vector<int> reuse;          ///< reuse distances in turn; empty: that of `tuning`
  bool staging = false;
  double patience = 10;
  int fail_device = -1;
  std::vector<int> delays;  ///< nanoseconds a task, by device
  std::string times;        ///< file for the times of all tasks
  device::cuda::DeviceTuning tuning;
  std::vector<std::string> systems;

  [[nodiscard]] Kind kind() const;
  /// The settings for every count of devices and every reuse distance, in turn.
  [[nodiscard]] std::vector<CheckSettings> variants() const;
};

/// Milliseconds of a refactorization and of a solve with one right-hand side that must be reached on one H200
/// (docs/notebook/gpu.md).
struct Floor {
  const char* system;
  double factor, solve;
};
const std::vector<Floor>& floors();

/// One system to be checked.
struct Wish {
  std::string system;
  Kind kind;
};
/// What the settings ask for: the systems named, else the small ones, else those with floors.
std::vector<Wish> wishes(const CheckSettings& settings);

/// Declares all options.
void declare(CLI::App& app, CheckSettings& settings, int argc, const char* const* argv);

}  // namespace espalier::bench

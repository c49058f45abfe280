/// \file
/// Options::device as text: a word and which devices of that kind.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "device/registry.hpp"

namespace espalier::solver {

/// N devices of M threads each.
struct HostDevices {
  int devices = 1;
  int threads = 1;
};
/// Reads "host:N" or "host:N,M". Without M, a device has an even part of `threads`, at least one; N M threads in all.
/// Empty for a text that is neither, or more than 4,096 threads.
std::optional<HostDevices> host_devices(const std::string& device, int threads);

/// What Options::device may be, for messages.
inline constexpr const char* kDeviceTexts =
    "auto, cpu, host:N, host:N,M (threads per host device; 4096 in all), gpu:all or gpu:0,1 (each once), or reference "
    "(slow: the textbook's method, to compare with)";

/// Options::device taken apart.
struct DeviceText {
  bool automatic = false;            ///< ours to choose
  std::string backend;               ///< by name
  bool whole_host = false;           ///< cpu: one device with all of the host's memory and threads
  std::optional<HostDevices> hosts;  ///< host:N
  std::vector<int> numbers;          ///< of the devices; empty: all
};
/// Empty for a text that is no device. Backends that this build lacks are known by their names; whether a device is
/// there is not looked at.
std::optional<DeviceText> read_device(const std::string& text, const device::Registry& registry);

/// Whether the text names a device of this build.
bool is_device(const std::string& text);

}  // namespace espalier::solver

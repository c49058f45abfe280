#include "solver/options/device_text.hpp"

#include <algorithm>
#include <charconv>

#include "solver/options/option_check.hpp"

namespace espalier::solver {

namespace {

constexpr std::size_t kMostNumbers = 16;  // no backend shares a plan among more devices that have numbers

// "0" or "0,1,2": every number once.
std::optional<std::vector<int>> number_list(const std::string& text) {
  std::vector<int> numbers;
  const char* at = text.data();
  const char* const end = at + text.size();
  for (;;) {
    int number = 0;
    const auto [stop, error] = std::from_chars(at, end, number);
    if (error != std::errc() || number < 0) return std::nullopt;
    if (std::find(numbers.begin(), numbers.end(), number) != numbers.end()) return std::nullopt;
    numbers.push_back(number);
    if (numbers.size() > kMostNumbers) return std::nullopt;
    if (stop == end) return numbers;
    if (*stop != ',') return std::nullopt;
    at = stop + 1;
  }
}

// "reference", which has one device; "gpu:all", "gpu:0,1".
std::optional<DeviceText> read_numbered(const std::string& text, const device::Registry& registry) {
  const std::size_t colon = text.find(':');
  DeviceText device;
  device.backend = text.substr(0, colon);
  const device::Backend* backend = registry.find(device.backend);
  if (backend == &registry.host() || (backend == nullptr && registry.find_left_out(device.backend) == nullptr))
    return std::nullopt;
  if (colon == std::string::npos) {
    if (backend == nullptr || backend->limits().most_devices > 1) return std::nullopt;
    return device;
  }
  const std::string which = text.substr(colon + 1);
  if (which == "all") return device;
  auto numbers = number_list(which);
  if (!numbers) return std::nullopt;
  device.numbers = std::move(*numbers);
  return device;
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

std::optional<DeviceText> read_device(const std::string& text, const device::Registry& registry) {
  DeviceText device;
  device.automatic = text == "auto";
  device.whole_host = text == "cpu";
  device.hosts = host_devices(text, 1);
  if (!device.automatic && !device.whole_host && !device.hosts) return read_numbered(text, registry);
  device.backend = registry.host().name();
  return device;
}

bool is_device(const std::string& text) { return read_device(text, device::registry()).has_value(); }

}  // namespace espalier::solver

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "experiments/experiments.hpp"

namespace espalier::bench {
namespace {

/// Devices on which the sweeps run unless told otherwise.
std::string sweep_device(const Bench& bench, const char* without_gpu) {
  const auto& rivals = bench.settings().rivals;
  if (!rivals.empty()) return rivals.front();
  return bench.gpus() > 0 ? "gpu:0" : without_gpu;
}

/// Most bytes that one device held, or what the row says of GPUs.
double device_peak(const nlohmann::json& row) {
  double most = 0;
  for (const auto& device : row.value("devices", nlohmann::json::array()))
    most = std::max(most, device.at("peak_bytes").get<double>());
  return most;
}

/// Rows of the largest front cannot be asked of a rival; what the factor weighs can.
double factor_bytes(const nlohmann::json& row) {
  const auto nonzeros = row.find("nonzeros_factor");
  return nonzeros != row.end() && nonzeros->is_number() ? 8.0 * nonzeros->get<double>() : std::nan("");
}

/// Bytes per second between a device and where its factor goes: the host link of a GPU, the memory of a host device.
double link_rate(const nlohmann::json& document, bool gpu) {
  const auto ceilings = document.find("ceilings");
  if (ceilings == document.end()) return std::nan("");
  if (gpu && !ceilings->at("gpus").empty()) return ceilings->at("gpus")[0].at("device_to_host_bytes_per_second");
  return ceilings->at("memory").at("triad_bytes_per_second").at("best");
}

nlohmann::json number_or_null(double value) {
  return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(nullptr);
}

void sweep_budgets(Bench& bench, const std::string& system, const std::string& device) {
  const std::string spec = "espalier:device=" + device;
  const auto whole = bench.measure(system, {{spec, {{"device", device}, {"share", nullptr}, {"budget_bytes", 0}}}});
  const nlohmann::json& row = whole.front();
  const double need = device_peak(row);
  nlohmann::json bounds = {{"system", system},
                           {"device", device},
                           {"need_bytes", number_or_null(need)},
                           {"factor_bytes", number_or_null(factor_bytes(row))},
                           {"in_core_seconds", number_or_null(measure::median(row, "refactorization"))}};
  // The factor must leave the device once, whatever else is moved.
  const double link = link_rate(bench.document(), device.starts_with("gpu"));
  bounds["link_bytes_per_second"] = number_or_null(link);
  bounds["link_seconds"] = number_or_null(factor_bytes(row) / link);
  bench.document()["bounds"].push_back(bounds);
  if (!(need > 0)) return;
  for (const std::string& share :
       bench.points({"1.25", "1", "0.75", "0.5", "0.35", "0.25", "0.125", "0.0625", "0.03"})) {
    double fraction = 0;
    try {
      fraction = std::stod(share);
    } catch (const std::logic_error&) {
      throw Error(StatusCode::invalid_input, share + ": a budget is a share of the need, such as 0.5");
    }
    const auto budget = static_cast<Offset>(std::ceil(need * fraction / 1024));
    bench.measure(system, {{fmt::format("{}+memory={}KiB", spec, budget),
                            {{"device", device}, {"share", fraction}, {"budget_bytes", budget * 1024}}}});
  }
}

}  // namespace

void run_block_size(Bench& bench) {
  const auto& asked = bench.settings().rivals;
  const std::string device = asked.empty() ? "cpu" : asked.front();
  std::vector<std::string> widths = {"0", "16", "32", "48", "64", "96", "128", "144", "192", "256", "384", "512"};
  if (device.starts_with("gpu")) widths = {"0", "32"};  // those that its kernels know
  std::vector<Contestant> contestants;
  for (const std::string& width : bench.points(widths)) {
    const std::string spec = "espalier:device=" + device;
    const bool automatic = width == "0" || width == "auto";
    contestants.push_back(
        {automatic ? spec : spec + "+block=" + width,
         {{"device", device}, {"block", automatic ? nlohmann::json("auto") : nlohmann::json(width)}}});
  }
  for (const std::string& system : bench.systems({"plate 100", "kkt 20 8 6 6", "elasticity 16"}))
    bench.measure(system, contestants);
}

void run_memory(Bench& bench) {
  const std::string device = sweep_device(bench, "host:2");
  bench.document()["bounds"] = nlohmann::json::array();
  for (const std::string& system : bench.systems({"elasticity 20", "plate 120"})) sweep_budgets(bench, system, device);
  bench.save();
}

}  // namespace espalier::bench

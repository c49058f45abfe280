#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "experiments/experiments.hpp"
#include "experiments/timeline.hpp"

namespace espalier::bench {
namespace {

/// How many devices "gpu:0,1", "gpu:all", "host:4" or "host:4,2" names.
int device_count(const std::string& device, int gpus) {
  if (device == "gpu:all") return gpus;
  if (device.starts_with("gpu:")) return 1 + static_cast<int>(std::count(device.begin(), device.end(), ','));
  if (device.starts_with("host:")) return std::max(1, std::atoi(device.c_str() + 5));
  return 1;
}

/// 1, 2, 4 ... GPUs where there are some, else as many host devices of one thread each as there are cores.
std::vector<std::string> default_devices(int gpus, int threads) {
  std::vector<std::string> devices;
  std::string list;
  for (int k = 0; k < gpus; ++k) {
    list += (k == 0 ? "gpu:" : ",") + std::to_string(k);
    if (((k + 1) & k) == 0) devices.push_back(list);
  }
  for (int n = 1; gpus == 0 && n <= std::max(2, threads); n *= 2) devices.push_back(fmt::format("host:{},1", n));
  return devices;
}

/// Mean over the devices of the share of time outside tasks or waiting inside them; NaN where nobody tells.
double idle_of(const nlohmann::json& row) {
  const auto devices = row.value("devices", nlohmann::json::array());
  const double seconds = measure::median(row, "refactorization");
  if (devices.empty() || !(seconds > 0)) return std::nan("");
  double sum = 0;
  for (const auto& device : devices)
    sum += device.at("idle_fraction").get<double>() + device.at("waiting_seconds").get<double>() / seconds;
  return std::min(1.0, sum / static_cast<double>(devices.size()));
}

void set_number(nlohmann::json& row, const char* key, double value) {
  row[key] = std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(nullptr);
}

/// Writes speed-up over the system's row of fewest devices and idle share into its rows of the document.
void derive(nlohmann::json& document, const std::string& system) {
  double one = std::nan("");
  int least = 0;
  for (auto& row : document["rows"]) {
    if (row.at("system") != system) continue;
    const int devices = row.at("parameters").value("devices", 1);
    const double seconds = measure::median(row, "refactorization");
    if (std::isfinite(seconds) && (least == 0 || devices < least)) {
      least = devices;
      one = seconds * devices;
    }
  }
  for (auto& row : document["rows"]) {
    if (row.at("system") != system) continue;
    set_number(row, "speed_up", one / std::max(1, least) / measure::median(row, "refactorization"));
    set_number(row, "idle_fraction", idle_of(row));
  }
}

/// One more factorization with the timeline on, outside all statistics.
void add_timeline(Bench& bench, const std::string& system, const std::string& spec, const nlohmann::json& parameters) {
  const std::string path =
      (std::filesystem::temp_directory_path() / fmt::format("espalier-bench-{}.json", getpid())).string();
  Bench traced = bench.aside(1);
  const auto rows = traced.measure(system, {{spec + "+trace=" + path, parameters}});
  std::error_code none;
  if (rows.front().at("outcome") == "ok" && std::filesystem::exists(path)) {
    nlohmann::json timeline = read_timeline(path);
    timeline["system"] = system;
    timeline["parameters"] = parameters;
    bench.document()["timelines"].push_back(std::move(timeline));
  }
  std::filesystem::remove(path, none);
}

}  // namespace

void run_scaling(Bench& bench) {
  std::vector<Contestant> contestants;
  for (const std::string& device : bench.points(default_devices(bench.gpus(), bench.plan().threads)))
    contestants.push_back(
        {"espalier:device=" + device, {{"device", device}, {"devices", device_count(device, bench.gpus())}}});
  for (const std::string& rival : bench.settings().rivals) contestants.push_back({rival, {{"devices", 1}}});
  bench.document()["timelines"] = nlohmann::json::array();
  for (const std::string& system : bench.systems({"elasticity 20", "plate 120", "kkt 8 8 6 6"})) {
    const auto rows = bench.measure(system, contestants);
    for (std::size_t k = 0; k < rows.size(); ++k)
      if (rows[k].at("outcome") == "ok" && contestants[k].spec.starts_with("espalier:"))
        add_timeline(bench, system, contestants[k].spec, contestants[k].parameters);
    derive(bench.document(), system);
    bench.save();
  }
}

void run_ablation(Bench& bench) {
  // The steps of the paper, each with all before it. A setting that the solver does not have makes a row that says so.
  struct Step {
    const char *name, *setting;  // null: cannot be switched
  };
  constexpr Step kSteps[] = {{"(a) one sub-tree per device", "+subtrees=0+nosteal+alonetop"},
                             {"(b) + balanced bisection", nullptr},
                             {"(c) + additional sub-trees", "+nosteal+alonetop"},
                             {"(d) + stealing", "+alonetop"},
                             {"(e) + shared top", ""}};
  const auto devices = bench.points({default_devices(bench.gpus(), bench.plan().threads).back()});
  for (const std::string& system : bench.systems({"elasticity 20", "plate 120"})) {
    auto& rows = bench.document()["rows"];
    const auto before = static_cast<std::ptrdiff_t>(rows.size());
    std::vector<Contestant> contestants;
    for (const std::string& device : devices) {
      const std::string spec = "espalier:device=" + device;
      nlohmann::json parameters = {{"device", device}, {"devices", device_count(device, bench.gpus())}};
      for (const Step& step : kSteps) {
        parameters["step"] = step.name;
        if (step.setting == nullptr)
          bench.add_row(system, {spec, parameters}, "not offered",
                        "the bisection always weighs its sides equally; there is no other to compare with");
        else
          contestants.push_back({spec + step.setting, parameters});
      }
    }
    bench.measure(system, contestants);
    const auto step_of = [](const auto& row) { return row.at("parameters").at("step").template get<std::string>(); };
    std::stable_sort(rows.begin() + before, rows.end(),
                     [&](const auto& a, const auto& b) { return step_of(a) < step_of(b); });
    derive(bench.document(), system);
    bench.save();
  }
}

}  // namespace espalier::bench

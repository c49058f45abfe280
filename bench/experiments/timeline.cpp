#include "experiments/timeline.hpp"

#include <algorithm>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "espalier/types.hpp"

namespace espalier::bench {
namespace {

constexpr double kGap = 1e-3;  // of the whole: less than a pixel of the plot

struct Track {
  std::string device, name;
  std::vector<std::pair<double, double>> tasks;  // seconds
};

nlohmann::json intervals(std::vector<std::pair<double, double>>& tasks, double gap, double& busy) {
  std::sort(tasks.begin(), tasks.end());
  std::vector<std::pair<double, double>> merged;
  for (const auto& [begin, end] : tasks) {
    busy += end - begin;
    if (!merged.empty() && begin - merged.back().second < gap)
      merged.back().second = std::max(merged.back().second, end);
    else
      merged.emplace_back(begin, end);
  }
  nlohmann::json list = nlohmann::json::array();
  for (const auto& [begin, end] : merged) list.push_back({begin, end});
  return list;
}

}  // namespace

nlohmann::json read_timeline(const std::string& path) {
  std::ifstream file(path);
  const auto trace = nlohmann::json::parse(file, nullptr, false);
  if (trace.is_discarded() || !trace.contains("traceEvents"))
    throw Error(StatusCode::invalid_input, path + ": is not a trace in the Chrome format");
  std::map<int, std::string> devices;
  std::map<int, Track> tracks;
  double end = 0;
  for (const auto& event : trace["traceEvents"]) {
    const int device = event.at("pid");
    if (event.at("ph") == "M") {
      const std::string& name = event.at("args").at("name").get_ref<const std::string&>();
      if (event.at("name") == "process_name")
        devices[device] = name;
      else
        tracks[event.at("tid")] = {devices[device], name, {}};
      continue;
    }
    const double begin = event.at("ts").get<double>() * 1e-6;
    tracks[event.at("tid")].tasks.emplace_back(begin, begin + event.at("dur").get<double>() * 1e-6);
    end = std::max(end, tracks[event.at("tid")].tasks.back().second);
  }
  nlohmann::json record = {{"seconds", end}, {"tracks", nlohmann::json::array()}};
  for (auto& [number, track] : tracks) {
    double busy = 0;
    nlohmann::json list = intervals(track.tasks, kGap * end, busy);
    record["tracks"].push_back(
        {{"device", track.device}, {"name", track.name}, {"busy", std::move(list)}, {"busy_seconds", busy}});
  }
  return record;
}

}  // namespace espalier::bench

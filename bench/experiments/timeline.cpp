#include "experiments/timeline.hpp"

#include <algorithm>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <vector>

#include "espalier/types.hpp"

namespace espalier::bench {
namespace {

constexpr double kGap = 1e-3;  // of the whole: less than a pixel of the plot

struct Span {
  double begin, end, waited;  // seconds
};

struct Track {
  std::string device, name;
  std::vector<Span> tasks;
};

nlohmann::json record_of(Track& track, double gap) {
  std::sort(track.tasks.begin(), track.tasks.end(), [](const Span& a, const Span& b) { return a.begin < b.begin; });
  std::vector<Span> merged;
  double busy = 0, waiting = 0;
  for (const Span& task : track.tasks) {
    busy += task.end - task.begin - task.waited;
    waiting += task.waited;
    if (merged.empty() || task.begin - merged.back().end >= gap) {
      merged.push_back(task);
    } else {
      merged.back().end = std::max(merged.back().end, task.end);
      merged.back().waited += task.waited;
    }
  }
  nlohmann::json record = {{"device", track.device},
                           {"name", track.name},
                           {"busy", nlohmann::json::array()},
                           {"waiting", nlohmann::json::array()},
                           {"busy_seconds", busy},
                           {"waiting_seconds", waiting}};
  for (const Span& span : merged) {
    record["busy"].push_back({span.begin, span.end});
    record["waiting"].push_back(span.waited);
  }
  return record;
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
    const double waited = event.at("args").value("waited", 0.0) * 1e-6;
    tracks[event.at("tid")].tasks.push_back({begin, begin + event.at("dur").get<double>() * 1e-6, waited});
    end = std::max(end, tracks[event.at("tid")].tasks.back().end);
  }
  nlohmann::json record = {{"seconds", end}, {"tracks", nlohmann::json::array()}};
  for (auto& [number, track] : tracks) record["tracks"].push_back(record_of(track, kGap * end));
  return record;
}

}  // namespace espalier::bench

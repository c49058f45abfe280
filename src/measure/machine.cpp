#include "measure/machine.hpp"

#include <sched.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "commit.hpp"

namespace espalier::measure {
namespace {

/// Text behind the first "key ... :" in a file of such lines; empty where there is none.
std::string field(const std::string& path, const std::string& key) {
  std::ifstream file(path);
  std::string line;
  while (std::getline(file, line)) {
    const std::size_t colon = line.find(':');
    if (colon == std::string::npos || line.substr(0, line.find_last_not_of(" \t", colon - 1) + 1) != key) continue;
    const std::size_t start = line.find_first_not_of(" \t", colon + 1);
    return start == std::string::npos ? "" : line.substr(start);
  }
  return "";
}

std::vector<std::string> gpu_names() {
  std::vector<std::string> names;
  std::error_code none;
  for (const auto& gpu : std::filesystem::directory_iterator("/proc/driver/nvidia/gpus", none))
    names.push_back(field(gpu.path() / "information", "Model"));
  return names;
}

}  // namespace

int usable_cores() {
  cpu_set_t cores;
  CPU_ZERO(&cores);
  return sched_getaffinity(0, sizeof cores, &cores) == 0 ? CPU_COUNT(&cores) : 1;
}

nlohmann::json machine_record() {
  utsname system{};
  uname(&system);
  double load = 0;
  getloadavg(&load, 1);
  const double page = static_cast<double>(sysconf(_SC_PAGESIZE));
  return {{"processor", field("/proc/cpuinfo", "model name")},
          {"family", field("/proc/cpuinfo", "cpu family")},
          {"model", field("/proc/cpuinfo", "model")},
          {"cores", usable_cores()},
          {"memory_bytes", page * static_cast<double>(sysconf(_SC_PHYS_PAGES))},
          {"kernel", std::string(system.sysname) + " " + system.release + " " + system.machine},
          {"load_average_before", load},
          {"gpus", gpu_names()},
          {"compiler", std::string("g++-compatible ") + __VERSION__}};
}

std::string source_commit() { return ESPALIER_COMMIT; }

std::string utc_now() {
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &utc);
  return text;
}

}  // namespace espalier::measure

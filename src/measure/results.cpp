#include "measure/results.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <filesystem>

#include "espalier/types.hpp"
#include "matrix/file.hpp"

namespace espalier::measure {

namespace {

struct Known {
  const char *name, *title, *explanation;
};
/// In the order in which a report shows them.
constexpr Known kKnown[] = {
    {"peers", "Solvers side by side",
     "Every solver has the same matrix, the same right-hand sides and its own process; they work in turns. Medians."},
    {"gpu-check", "The executors alone, values on the device",
     "Refactorization and solve with values and right-hand sides that lie in device memory; repeated bit for bit."},
    {"memory", "Time against the memory of a device",
     "The budget of each device as a share of what it needs in core. Below the floor the solver says what it needs."},
    {"scaling", "Several devices", "Speed-up over one device, and the share of time in which devices idle or wait."},
    {"simulated", "Simulated: the plans of several GPUs in virtual time",
     "The assignment and the tasks of the real plan; times of tasks and links from the cost model fitted to an H200."},
    {"ablation", "What each idea of sharing brings", "Each step keeps what the steps before it brought."},
    {"block-size", "Widest block of a front",
     "Refactorization against the widest block column that a front may be cut into; auto: by the size of the front."},
    {"refactor", "Latency of a Newton step",
     "Refactorization and solve with one right-hand side in a row, as an implicit integrator calls them."},
    {"growth", "Growth with the number of unknowns",
     "Power laws fitted to the points. Theory: operations grow with the power 1.5 of n in two dimensions, 2 in three."},
    {"overhead", "What the benchmark adds", "The same calls in a plain loop of one process, and under the benchmark."},
    {"ceilings", "Limits of the machine",
     "Our dense product, main memory and links: what every rate is compared with."},
};

const Known* known(const std::string& experiment) {
  for (const Known& one : kKnown)
    if (experiment == one.name) return &one;
  return nullptr;
}

[[noreturn]] void reject(const std::string& path, const std::string& why) {
  throw Error(StatusCode::invalid_input, fmt::format("{}: {}", path, why));
}

}  // namespace

Results read_results(const std::string& path) {
  Results results;
  results.data = Json::parse(matrix::FileBytes(path).bytes(), nullptr, false);
  if (results.data.is_discarded() || !results.data.is_object()) reject(path, "is not a JSON object");
  if (results.data.value("schema", Json()) != kSchema)
    reject(path, fmt::format("has schema {}; this reads {} (written by `espalier bench`)",
                             results.data.value("schema", Json()).dump(), kSchema));
  for (const char* key : {"experiment", "date", "machine", "rows"})
    if (!results.data.contains(key)) reject(path, fmt::format("lacks \"{}\"", key));
  if (!results.rows().is_array() || !results.data["machine"].is_object())
    reject(path, "rows or machine have no content");
  for (const Json& row : results.rows())
    if (!row.contains("system") || !row.contains("outcome")) reject(path, "has a row without system or outcome");
  results.file = std::filesystem::path(path).filename().string();
  results.id = slug(results.file.ends_with(".json") ? results.file.substr(0, results.file.size() - 5) : results.file);
  return results;
}

std::string slug(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (std::isalnum(static_cast<unsigned char>(c)) != 0)
      out += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    else if (!out.empty() && out.back() != '-')
      out += '-';
  }
  while (out.ends_with('-')) out.pop_back();
  return out;
}

std::string title_of(const std::string& experiment) {
  const Known* one = known(experiment);
  return one != nullptr ? one->title : experiment;
}

std::string heading_of(const Results& results) {
  const std::string subject = text(results.data, "subject");
  return title_of(results.experiment()) + (subject.empty() ? "" : ": " + subject);
}

void sort_results(std::vector<Results>& all) {
  const auto rank = [](const Results& results) {
    return std::find_if(std::begin(kKnown), std::end(kKnown),
                        [&](const Known& one) { return results.experiment() == one.name; });
  };
  std::stable_sort(all.begin(), all.end(), [&](const Results& a, const Results& b) {
    return std::pair(rank(a), a.file) < std::pair(rank(b), b.file);
  });
}

std::string explanation_of(const std::string& experiment) {
  const Known* one = known(experiment);
  return one != nullptr ? one->explanation : "";
}

std::string machine_of(const Results& results) {
  const Json& machine = results.data.at("machine");
  std::string words = text(machine, "processor");
  const auto add = [&words](const std::string& more) { words += (words.empty() ? "" : ", ") + more; };
  if (machine.contains("cores")) add(machine["cores"].dump() + " cores");
  const Json gpus = machine.value("gpus", Json::array());
  if (!gpus.empty()) add((gpus.size() > 1 ? fmt::format("{} x ", gpus.size()) : "") + gpus[0].get<std::string>());
  return words.empty() ? "unknown machine" : words;
}

}  // namespace espalier::measure

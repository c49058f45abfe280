#include <fmt/format.h>

#include <algorithm>

#include "experiments/experiments.hpp"

namespace espalier::bench {
namespace {

/// Contestants that take turns on one system, and how often.
struct Stage {
  std::vector<std::string> rivals;
  std::string system;
  int repetitions, analyses;
  Index columns;    ///< right-hand sides of the second solve
  double estimate;  ///< seconds in all, on 16 cores and one H200
};

using Words = std::vector<std::string>;

/// Systems by the name of a set. "quick" ends within 5 minutes on 2 cores.
Words systems_of(const std::string& set) {
  if (set == "quick") return {"elasticity 12", "plate 80 80", "kkt 4 8 6 6", "kkt 100 3 2 2", "gyroscopic 10"};
  return {"elasticity 20", "plate 200 200", "kkt 20", "kkt 200 3 2 2", "gyroscopic 24"};
}

const char* const kOurs = "espalier:device=gpu:0";
const char* const kOursResident = "espalier:device=gpu:0+resident+refine=0";  // as cuDSS: no refinement

Words together(const std::vector<Words>& groups) {
  Words all;
  for (const Words& group : groups) all.insert(all.end(), group.begin(), group.end());
  return all;
}

/// The tables of the GPU (docs/notebook/gpu.md), in the order of their worth, so that a limit of time costs
/// least: everyone in turns on small and middle systems; ours and cuDSS in turns on the large ones; cuDSS's other modes
/// on them; last PARDISO alone, whose calls take up to minutes there and are made once or twice.
std::vector<Stage> gpu_stages() {
  const Words cpu = {"espalier:device=cpu"}, ours = {kOurs, kOursResident}, resident = {kOursResident};
  const Words cudss = {"cudss"}, modes = {"cudss:deterministic", "cudss:hybrid"}, pardiso = {"pardiso"};
  const Words everyone = together({ours, cpu, cudss, modes, pardiso});
  const Words gpu = together({ours, cudss}), two = together({resident, cudss});
  return {{everyone, "kkt 1000 2 1 1", 5, 2, 1, 10},
          {everyone, "kkt 200 3 2 2", 5, 2, 1, 10},
          {everyone, "kkt 2", 5, 2, 1, 10},
          {everyone, "kkt 20", 3, 1, 1, 12},
          {everyone, "elasticity 20", 3, 1, 1, 8},
          {everyone, "gyroscopic 24", 3, 1, 1, 10},
          {everyone, "elasticity 40", 2, 1, 32, 40},
          {gpu, "plate 600", 2, 1, 1, 17},
          {gpu, "kkt 400 10 8 8", 2, 1, 1, 20},
          {gpu, "gyroscopic 48", 2, 1, 1, 15},
          {two, "elasticity 64", 2, 1, 1, 15},
          {two, "elasticity 64 as ldlt", 1, 1, 1, 18},
          {two, "elasticity 80", 1, 1, 1, 32},
          {two, "plate 1200", 1, 1, 1, 45},
          {modes, "plate 600", 1, 1, 1, 12},
          {modes, "gyroscopic 48", 1, 1, 1, 14},
          {modes, "elasticity 64", 1, 1, 1, 16},
          {modes, "kkt 400 10 8 8", 1, 1, 1, 22},
          {modes, "elasticity 64 as ldlt", 1, 1, 1, 25},
          {modes, "plate 1200", 1, 1, 1, 45},
          {modes, "elasticity 80", 1, 1, 1, 40},
          {pardiso, "gyroscopic 48", 0, 1, 1, 18},
          {pardiso, "kkt 400 10 8 8", 1, 1, 1, 20},
          {pardiso, "plate 600", 1, 1, 1, 24},
          {pardiso, "elasticity 64", 0, 1, 1, 55},
          {pardiso, "plate 1200", 0, 1, 1, 65},
          {pardiso, "elasticity 64 as ldlt", 0, 1, 1, 65},
          {pardiso, "elasticity 80", 0, 1, 1, 240}};
}

/// All GPUs of this machine beside one: ours and cuDSS.
std::vector<Stage> gpus_stages(int gpus) {
  std::string list = "gpu:0";
  for (int k = 1; k < gpus; ++k) list += fmt::format(",{}", k);
  const std::string several = fmt::format("cudss:gpus={}", gpus);
  const Words rivals = {kOursResident, fmt::format("espalier:device={}+resident+refine=0", list), "cudss", several};
  std::vector<Stage> stages = {{rivals, "kkt 20", 3, 1, 1, 10},
                               {rivals, "elasticity 64", 3, 1, 1, 40},
                               {rivals, "kkt 400 10 8 8", 3, 1, 1, 50},
                               {rivals, "plate 1200", 3, 1, 1, 120}};
  for (const std::string& rival : {rivals[1], several, rivals[0], rivals[2]})  // they do not fit side by side
    stages.push_back({{rival}, "elasticity 96", 1, 1, 1, 60});
  return stages;
}

Words rivals_of(const std::string& set, int gpus) {
  if (set == "gpu") return {kOurs, kOursResident, "cudss", "pardiso"};
  Words rivals = {"espalier", "pardiso", "cholmod", "mumps", "eigen", "cudss"};
  if (gpus > 0) rivals.insert(rivals.begin() + 1, kOurs);
  return rivals;
}

/// Rows of one system stand together, in the order in which systems came first.
void gather_systems(nlohmann::json& rows) {
  std::vector<nlohmann::json> sorted;
  std::vector<std::string> order;
  for (const auto& row : rows) {
    const auto system = row.at("system").get<std::string>();
    if (std::find(order.begin(), order.end(), system) == order.end()) order.push_back(system);
  }
  for (const std::string& system : order)
    for (auto& row : rows)
      if (row.at("system") == system) sorted.push_back(row);
  rows = sorted;
}

void run_stages(Bench& bench, const std::vector<Stage>& stages) {
  const Settings& settings = bench.settings();
  for (const char* key : {"repetitions", "analyses", "right_hand_sides"})
    bench.document()["settings"][key] = "by stage; see the samples of each row";
  for (const Stage& stage : stages) {
    Plan& plan = bench.plan();
    plan.repetitions = settings.repetitions.value_or(stage.repetitions);
    plan.analyses = settings.analyses > 0 ? settings.analyses : stage.analyses;
    plan.columns = stage.columns;
    std::vector<Contestant> contestants;
    for (const std::string& rival : stage.rivals) contestants.push_back({rival});
    bench.measure(stage.system, contestants, stage.estimate);
    gather_systems(bench.document()["rows"]);
    bench.save();
  }
}

}  // namespace

void run_peers(Bench& bench) {
  const Settings& settings = bench.settings();
  if (settings.rivals.empty() && settings.systems.empty()) {
    if (settings.set == "gpu") return run_stages(bench, gpu_stages());
    if (settings.set == "gpus") return run_stages(bench, gpus_stages(bench.gpus()));
  }
  std::vector<Contestant> contestants;
  for (const std::string& rival : settings.rivals.empty() ? rivals_of(settings.set, bench.gpus()) : settings.rivals)
    contestants.push_back({rival});
  for (const std::string& system : bench.systems(systems_of(settings.set))) bench.measure(system, contestants);
}

}  // namespace espalier::bench

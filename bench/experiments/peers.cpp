#include "experiments/experiments.hpp"

namespace espalier::bench {
namespace {

/// Systems by the name of a set. "quick" ends within 5 minutes on 2 cores; "gpu" are those of the GPU tables in
/// docs/performance.md.
std::vector<std::string> systems_of(const std::string& set) {
  if (set == "quick") return {"elasticity 12", "plate 80 80", "kkt 4 8 6 6", "kkt 100 3 2 2", "gyroscopic 10"};
  if (set == "gpu")
    return {"elasticity 20", "elasticity 40", "elasticity 64",  "plate 600",      "plate 1200",    "kkt 2",
            "kkt 20",        "kkt 200 3 2 2", "kkt 1000 2 1 1", "kkt 400 10 8 8", "gyroscopic 24", "gyroscopic 48"};
  return {"elasticity 20", "plate 200 200", "kkt 20", "kkt 200 3 2 2", "gyroscopic 24"};
}

std::vector<std::string> rivals_of(const std::string& set, int gpus) {
  if (set == "gpu") return {"espalier:device=gpu:0", "cudss", "pardiso"};
  std::vector<std::string> rivals = {"espalier", "pardiso", "cholmod", "mumps", "eigen", "cudss"};
  if (gpus > 0) rivals.insert(rivals.begin() + 1, "espalier:device=gpu:0");
  return rivals;
}

}  // namespace

void run_peers(Bench& bench) {
  const Settings& settings = bench.settings();
  std::vector<Contestant> contestants;
  const auto rivals = settings.rivals.empty() ? rivals_of(settings.set, bench.gpus()) : settings.rivals;
  for (const std::string& rival : rivals) contestants.push_back({rival});
  for (const std::string& system : bench.systems(systems_of(settings.set))) bench.measure(system, contestants);
}

}  // namespace espalier::bench

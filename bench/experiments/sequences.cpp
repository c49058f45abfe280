#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <sstream>

#include "experiments/experiments.hpp"
#include "experiments/fit.hpp"
#include "rivals/table.hpp"

namespace espalier::bench {
namespace {

std::vector<Contestant> contestants_or(const Bench& bench, const std::vector<std::string>& defaults) {
  std::vector<Contestant> contestants;
  const auto& asked = bench.settings().rivals;
  for (const std::string& rival : asked.empty() ? defaults : asked) contestants.push_back({rival});
  return contestants;
}

/// Refactorization and solve of the same round, added: what a Newton step waits for.
nlohmann::json newton_step(const nlohmann::json& row) {
  if (!row.contains("refactorization") || !row["refactorization"].is_object() || !row["solve_one"].is_object())
    return nullptr;
  Samples sum{row["refactorization"]["seconds"].get<std::vector<double>>()};
  const auto solves = row["solve_one"]["seconds"].get<std::vector<double>>();
  for (std::size_t k = 0; k < std::min(sum.seconds.size(), solves.size()); ++k) sum.seconds[k] += solves[k];
  return measure::samples_record(sum);
}

/// Family of a generated system by its first word, with the dimension of its separators' theory; 0: unknown.
int dimension_of(const std::string& family) {
  if (family == "plate" || family == "shell") return 2;
  if (family == "elasticity" || family == "poisson" || family == "gyroscopic") return 3;
  return 0;
}

/// What nested dissection gives for the exponent of n (George 1973; Lipton, Rose, Tarjan 1979; in 2-D the factor's
/// entries grow like n log n, which reads as a little more than 1).
nlohmann::json theory(int dimension, const std::string& quantity) {
  if (quantity == "flops" || quantity == "refactorization")
    return dimension == 2 ? nlohmann::json(1.5) : nlohmann::json(2.0);
  if (quantity == "nonzeros_factor" || quantity == "peak_bytes" || quantity == "solve_one")
    return dimension == 2 ? nlohmann::json(1.0) : nlohmann::json(4.0 / 3.0);
  return nullptr;
}

double quantity_of(const nlohmann::json& row, const std::string& quantity) {
  if (quantity == "peak_bytes") {
    const auto& peak = row.at("memory").at("peak_bytes");
    return peak.is_number() ? peak.get<double>() : std::nan("");
  }
  if (quantity == "flops" || quantity == "nonzeros_factor")
    return row.at(quantity).is_number() ? row.at(quantity).get<double>() : std::nan("");
  return measure::median(row, quantity.c_str());
}

void fit_family(nlohmann::json& document, const std::string& family, const std::string& rival) {
  for (const char* quantity : {"analysis", "refactorization", "solve_one", "flops", "nonzeros_factor", "peak_bytes"}) {
    std::vector<double> n, y;
    for (const auto& row : document["rows"]) {
      if (row.at("outcome") != "ok" || row.at("rival") != rival || row.at("parameters").at("family") != family)
        continue;
      const double value = quantity_of(row, quantity);
      if (!(value > 0)) continue;
      n.push_back(row.at("unknowns"));
      y.push_back(value);
    }
    const PowerLaw law = fit_power_law(n, y);
    if (law.points < 3) continue;
    document["fits"].push_back({{"family", family},
                                {"rival", rival},
                                {"quantity", quantity},
                                {"exponent", law.exponent},
                                {"factor", law.factor},
                                {"r_squared", law.r_squared},
                                {"points", law.points},
                                {"theory", theory(dimension_of(family), quantity)}});
  }
}

}  // namespace

void run_refactor(Bench& bench) {
  Plan& plan = bench.plan();
  plan.columns = 1;
  if (!bench.settings().repetitions) plan.repetitions = 25;
  if (bench.settings().analyses == 0) plan.analyses = 1;
  std::vector<std::string> rivals = {"espalier", "pardiso", "mumps", "eigen"};
  if (bench.gpus() > 0) rivals.insert(rivals.end(), {"espalier:device=gpu:0", "cudss"});
  const auto contestants = contestants_or(bench, rivals);
  const std::vector<std::string> generated = {"kkt 9 3 2 2",  "kkt 27 3 2 2", "kkt 90 3 2 2", "kkt 270 3 2 2",
                                              "elasticity 6", "elasticity 9", "elasticity 14"};
  // Folders stay folders: each is the sequence of Newton matrices of one simulation.
  for (const std::string& system : bench.settings().systems.empty() ? generated : bench.settings().systems) {
    bench.measure(system, contestants);
    for (auto& row : bench.document()["rows"])
      if (row.at("system") == system) row["newton_step"] = newton_step(row);
    bench.save();
  }
}

void run_growth(Bench& bench) {
  if (!bench.settings().repetitions) bench.plan().repetitions = 3;
  if (bench.settings().analyses == 0) bench.plan().analyses = 1;
  bench.plan().columns = 1;
  bench.document()["fits"] = nlohmann::json::array();
  std::map<std::string, std::vector<std::string>> families;
  for (const std::string& system : bench.systems({"plate 30", "plate 60", "plate 120", "plate 240", "elasticity 7",
                                                  "elasticity 10", "elasticity 14", "elasticity 20", "elasticity 28"}))
    families[system.substr(0, system.find(' '))].push_back(system);
  for (const auto& [family, systems] : families) {
    auto contestants = contestants_or(bench, {"espalier"});
    for (Contestant& contestant : contestants)
      contestant.parameters = {{"family", family}, {"dimension", dimension_of(family)}};
    for (const std::string& system : systems) bench.measure(system, contestants);
    for (const Contestant& contestant : contestants) fit_family(bench.document(), family, contestant.spec);
  }
  for (const auto& fit : bench.document()["fits"])
    bench.print(fmt::format("{:<12} {:<10} {:<16} n^{:.2f}, theory {}\n", fit["family"].get<std::string>(),
                            fit["rival"].get<std::string>(), fit["quantity"].get<std::string>(),
                            fit["exponent"].get<double>(), fit["theory"].dump()));
  bench.save();
}

}  // namespace espalier::bench

// Systems of exactly known rank and inertia (exact.hpp) in many disguises, each judged by the solver. Prints a line for
// every one that is wrong and a table at the end; exit code 1 where one was wrong.
//   espalier_exact [CASES [SEED]]     default: 2000 cases from seed 1
#include <cstdio>
#include <cstdlib>
#include <map>
#include <string>

#include "verdict/exact.hpp"

using namespace espalier;  // NOLINT(google-build-using-namespace): a program of one file

namespace {

struct Tally {
  int runs = 0, singular = 0, ill_conditioned = 0, late = 0, wrong = 0;
};

void try_one(std::uint64_t seed, std::map<std::string, Tally>& tallies) {
  constexpr double kMostCondition = 1e10;
  const verdict::ExactCase c = verdict::make_exact_case(seed);
  Tally& tally = tallies[c.name + (c.complex ? ", complex" : ", real")];
  verdict::Trial trial = verdict::make_trial(c, seed);
  if (std::getenv("VERDICT_LOG") != nullptr)
    trial.options.log = [](const std::string& line) { std::printf("  %s\n", line.c_str()); };
  std::string wrong = c.zeros < 0 ? "the two truths contradict each other" : "";
  if (wrong.empty() && c.condition > kMostCondition) {
    ++tally.ill_conditioned;
    return;
  }
  ++tally.runs;
  tally.singular += c.zeros > 0 ? 1 : 0;
  if (wrong.empty()) wrong = verdict::judge(c, trial.disguise, trial.options, seed);
  if (wrong == "late") {
    ++tally.late;
    return;
  }
  if (wrong.empty()) return;
  ++tally.wrong;
  std::printf("WRONG seed %llu, n %d, %d zeros, %s: %s (%s)\n", static_cast<unsigned long long>(seed), c.a.n, c.zeros,
              c.name.c_str(), wrong.c_str(), trial.name.c_str());
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  const int cases = argc > 1 ? std::atoi(argv[1]) : 2000;
  const auto seed = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : std::uint64_t{1};
  std::map<std::string, Tally> tallies;
  for (int k = 0; k < cases; ++k) try_one(seed + static_cast<std::uint64_t>(k), tallies);
  std::printf("%-34s %8s %9s %8s %6s %6s\n", "structure", "runs", "singular", "ill", "late", "wrong");
  Tally all;
  const auto row = [](const std::string& name, const Tally& t) {
    std::printf("%-34s %8d %9d %8d %6d %6d\n", name.c_str(), t.runs, t.singular, t.ill_conditioned, t.late, t.wrong);
  };
  for (const auto& [name, t] : tallies) {
    row(name, t);
    all.runs += t.runs;
    all.singular += t.singular;
    all.ill_conditioned += t.ill_conditioned;
    all.late += t.late;
    all.wrong += t.wrong;
  }
  row("all", all);
  return all.wrong == 0 ? 0 : 1;
}

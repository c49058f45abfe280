/// \file
/// What the benchmark adds to what it times: its turns beside a plain loop, in alternation.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "espalier/solver.hpp"
#include "experiments/experiments.hpp"
#include "matrix/residual.hpp"
#include "rivals/systems.hpp"
#include "rivals/table.hpp"

namespace espalier::bench {
namespace {

constexpr const char* kPhases[] = {"refactorization", "solve_one"};

/// Seconds of a call after others, as in a turn of the benchmark; `prepare` runs right before it.
template <typename Prepare, typename Call>
double timed_warm(double& last, Prepare&& prepare, Call&& call) {
  struct Seconds {
    double seconds;
  };
  warm_up(last, [&] { return Seconds{timed(call)}; });
  prepare();
  return last = timed(call);
}

/// The same calls in this process in a plain loop: no other process, no shared memory, no turns. New values are written
/// right before they are factorized, as a Newton loop does: they take their part of the caches.
nlohmann::json plain_row(const std::string& system, const SparseMatrix& a, const Plan& plan) {
  Options options;
  options.device = "cpu";
  options.threads = plan.threads;
  Solver solver(options);
  Samples refactorization, solve_one;
  std::vector<double> x(static_cast<std::size_t>(a.rows)), b(x.size()), values = a.values;
  std::mt19937_64 generator(1);
  for (double& v : b) v = std::uniform_real_distribution<double>(-1, 1)(generator);
  constexpr double kNever = std::numeric_limits<double>::infinity();
  double last_factor = kNever, last_solve = kNever;
  Status status = solver.analyze(a).status;
  if (status.ok()) status = solver.factorize(a).status;
  for (int round = 0; status.ok() && round <= plan.repetitions; ++round) {
    if (!plan.warm) last_factor = last_solve = kNever;
    const auto assemble = [&] {
      for (std::size_t k = 0; k < values.size(); ++k) values[k] = a.values[k] * (1 + round / 16.0);
    };
    const double factor = timed_warm(last_factor, assemble, [&] { status = solver.refactorize(values).status; });
    if (!status.ok()) break;
    const double solve = timed_warm(
        last_solve, [] {}, [&] { status = solver.solve(b, x).status; });
    if (round == 0) continue;
    refactorization.seconds.push_back(factor);
    solve_one.seconds.push_back(solve);
  }
  nlohmann::json row = {
      {"system", system},         {"rival", "espalier, plain loop"}, {"parameters", {{"in", "plain loop"}}},
      {"unknowns", a.rows},       {"nonzeros", a.nonzeros()},        {"outcome", status.ok() ? "ok" : "failed"},
      {"message", status.message}};
  if (!status.ok()) return row;
  MatrixView last = a;
  last.values = values;
  const matrix::BackwardErrors error = matrix::backward_errors(last, x, b);
  row["refactorization"] = measure::samples_record(refactorization);
  row["solve_one"] = measure::samples_record(solve_one);
  row["backward_error"] = {{"normwise", error.normwise}, {"componentwise", error.componentwise}};
  return row;
}

/// Mean of the pairs' ratios less one, and its standard error.
std::pair<double, double> mean_and_error(const std::vector<double>& ratios) {
  const auto n = static_cast<double>(ratios.size());
  double mean = 0, squares = 0;
  for (const double r : ratios) mean += r / n;
  for (const double r : ratios) squares += (r - mean) * (r - mean);
  return {mean - 1, n > 1 ? std::sqrt(squares / (n - 1) / n) : std::nan("")};
}

/// Both sides of one system: their rows, with the samples of all pairs so far, and each pair's ratio of medians.
struct Sides {
  nlohmann::json bench, plain;
  std::vector<double> ratios[2];  ///< by phase

  [[nodiscard]] bool ok() const { return bench.at("outcome") == "ok" && plain.at("outcome") == "ok"; }

  void add(nlohmann::json next_bench, nlohmann::json next_plain) {
    const bool first = bench.is_null();
    const Sides before = *this;
    bench = std::move(next_bench);
    plain = std::move(next_plain);
    if (!ok()) return;
    for (int k = 0; k < 2; ++k)
      ratios[k].push_back(measure::median(bench, kPhases[k]) / measure::median(plain, kPhases[k]));
    if (first) return;
    for (const char* phase : kPhases) {
      bench[phase] = joined(before.bench[phase], bench[phase]);
      plain[phase] = joined(before.plain[phase], plain[phase]);
    }
  }

 private:
  static nlohmann::json joined(const nlohmann::json& one, const nlohmann::json& other) {
    Samples all{one.at("seconds").get<std::vector<double>>()};
    for (const double seconds : other.at("seconds")) all.seconds.push_back(seconds);
    return measure::samples_record(all);
  }
};

/// `pairs` times a block of rounds of each, who begins in turns: what drifts (clock of the cores, other work) meets
/// both.
Sides alternate(const std::string& system, Bench& aside, int pairs) {
  Sides sides;
  const SparseMatrix a = make_system(system);
  for (int pair = 0; pair < pairs && (pair == 0 || sides.ok()); ++pair) {
    nlohmann::json plain;
    if (pair % 2 == 0) plain = plain_row(system, a, aside.plan());
    nlohmann::json bench = aside.measure(system, {{"espalier", {{"in", "benchmark"}}}}).front();
    if (pair % 2 == 1) plain = plain_row(system, a, aside.plan());
    sides.add(std::move(bench), std::move(plain));
  }
  return sides;
}

void report(Bench& bench, const std::string& system, const Sides& sides) {
  for (int k = 0; k < 2; ++k) {
    const char* phase = kPhases[k];
    const auto [mean, error] = mean_and_error(sides.ratios[k]);
    const double least = sides.bench[phase]["least"].get<double>() / sides.plain[phase]["least"].get<double>() - 1;
    bench.document()["overhead"].push_back({{"system", system},
                                            {"phase", phase},
                                            {"of_medians", mean},
                                            {"error", std::isfinite(error) ? nlohmann::json(error) : nullptr},
                                            {"of_least", least}});
    bench.print(fmt::format("{}, {}: {:+.2f} % of {:.3g} ms by medians (standard error {:.2f}), {:+.2f} % by least\n",
                            system, phase, 1e2 * mean, 1e3 * measure::median(sides.plain, phase), 1e2 * error,
                            1e2 * least));
  }
}

}  // namespace

void run_overhead(Bench& bench) {
  constexpr int kPairs = 8, kRounds = 5;
  for (const std::string& system : bench.systems({"kkt 200 3 2 2", "elasticity 14", "plate 100"})) {
    Bench aside = bench.aside(std::max(1, bench.settings().repetitions.value_or(kRounds)));
    const Sides sides = alternate(system, aside, kPairs);
    bench.document()["rows"].push_back(sides.bench);
    bench.document()["rows"].push_back(sides.plain);
    if (sides.ok()) report(bench, system, sides);
    bench.save();
  }
}

}  // namespace espalier::bench

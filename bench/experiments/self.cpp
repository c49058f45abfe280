/// \file
/// The benchmark about itself and its machine: ceilings, and what the benchmark adds.
#include <fmt/format.h>

#include <limits>
#include <random>

#include "experiments/ceilings.hpp"
#include "experiments/experiments.hpp"
#include "matrix/residual.hpp"
#include "rivals/systems.hpp"
#include "rivals/table.hpp"

namespace espalier::bench {
namespace {

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
nlohmann::json bare_row(const std::string& system, const Plan& plan) {
  const SparseMatrix a = make_system(system);
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
  row["refactorization"] = samples_record(refactorization);
  row["solve_one"] = samples_record(solve_one);
  row["backward_error"] = {{"normwise", error.normwise}, {"componentwise", error.componentwise}};
  return row;
}

}  // namespace

void run_overhead(Bench& bench) {
  if (bench.settings().repetitions == 0) bench.plan().repetitions = 15;
  bench.plan().columns = 1;
  bench.plan().analyses = 1;
  for (const std::string& system : bench.systems({"kkt 200 3 2 2", "elasticity 14", "plate 100"})) {
    // Before and after, since the clock of the cores drifts: the better of the two stands for the plain loop.
    nlohmann::json before = bare_row(system, bench.plan());
    const auto rows = bench.measure(system, {{"espalier", {{"in", "benchmark"}}}});
    nlohmann::json after = bare_row(system, bench.plan());
    nlohmann::json& bare = median_of(after, "refactorization") < median_of(before, "refactorization") ? after : before;
    bench.document()["rows"].push_back(bare);
    for (const char* phase : {"refactorization", "solve_one"}) {
      const auto found = rows.front().find(phase);
      if (found == rows.front().end() || !found->is_object() || !bare.contains(phase)) continue;
      const double medians = median_of(rows.front(), phase) / median_of(bare, phase) - 1;
      const double least = found->at("least").get<double>() / bare[phase]["least"].get<double>() - 1;
      bench.document()["overhead"].push_back(
          {{"system", system}, {"phase", phase}, {"of_medians", medians}, {"of_least", least}});
      bench.print(
          fmt::format("{}, {}: {:+.2f} % by medians, {:+.2f} % by least\n", system, phase, 1e2 * medians, 1e2 * least));
    }
    bench.save();
  }
}

void run_ceilings(Bench& bench) {
  bench.document()["ceilings"] = measure_ceilings({bench.plan().threads, 1.0});
  const auto& found = bench.document()["ceilings"];
  const auto& memory = found["memory"];
  bench.print(fmt::format("matrix product, FP64, {}: {:.1f} GFLOP/s on one thread, {:.1f} on {}\n",
                          found["kernels"].get<std::string>(),
                          found["gemm_flops_per_second_one_thread"].get<double>() * 1e-9,
                          found["gemm_flops_per_second"].get<double>() * 1e-9, bench.plan().threads));
  bench.print(fmt::format("memory: read {:.1f} GB/s, triad {:.1f} GB/s\n",
                          memory["read_bytes_per_second"]["best"].get<double>() * 1e-9,
                          memory["triad_bytes_per_second"]["best"].get<double>() * 1e-9));
  for (const auto& gpu : found["gpus"]) bench.print(gpu.dump(1) + "\n");
  bench.save();
}

const std::vector<Experiment>& experiments() {
  static const std::vector<Experiment> all = {
      {"peers", "Every solver on the same systems in the same run", "", run_peers},
      {"block-size", "Time against the widest block column of a front", "widths (0: by the size of the front)",
       run_block_size},
      {"memory", "Time against the memory budget of a device", "budgets as shares of the need, such as 1,0.5,0.25",
       run_memory},
      {"scaling", "Time and idle share against the number of devices", "devices: host:1,1 host:2,1 gpu:0 gpu:0,1 ...",
       run_scaling},
      {"ablation", "What each idea of sharing work among devices brings", "devices: host:2,1 gpu:0,1 ...",
       run_ablation},
      {"refactor", "Latency of a Newton step from 1,000 unknowns up", "", run_refactor},
      {"growth", "Time and memory against n with fitted exponents", "", run_growth},
      {"ceilings", "Matrix product, memory and links of this machine", "", run_ceilings},
      {"overhead", "What the benchmark itself adds to what it times", "", run_overhead},
  };
  return all;
}

}  // namespace espalier::bench

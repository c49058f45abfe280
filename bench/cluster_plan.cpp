/// \file
/// Elasticity on cubes planned for clusters: times in virtual time on 1 to 1,024 H200s, and what ranks keep. Needs no
/// GPU and no matrix of the size: the nodes' graph is ordered, with three unknowns a node.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <exception>
#include <nlohmann/json.hpp>

#include "analysis/ordering.hpp"
#include "cluster/cluster_simulator.hpp"
#include "device/cuda/tables/device_plan.hpp"
#include "measure/document.hpp"

namespace espalier::bench {
namespace {

struct Settings {
  std::vector<int> cubes = {96, 128, 160}, counts, ranks;
  int threads = 2;
  std::string out, command;
  ClusterRates rates;
};

constexpr double kGiB = 1024.0 * 1024 * 1024;

nlohmann::json show_run(int cube, int devices, const analysis::AssemblyTree& tree, const Settings& s) {
  device::cuda::DeviceTuning tuning;
  plan::PlanOptions options = device::cuda::cuda_plan_options(Kind::llt, tuning, devices);
  options.ranks = std::max<Index>(1, devices / s.rates.per_machine);
  const plan::Plan plan = plan_of_tree(tree, 3, options);
  const ClusterRun r = simulate(plan, s.rates);
  fmt::print(
      "{:>5}^3 {:>6} {:>9.3f} s {:>7.1f} TF/s a GPU {:>4.0f} % busy   work {:.3f}, chain {:.3f}, network {:.3f} s, "
      "{:>7.0f} GB sent, factor {:.1f} GiB a GPU\n",
      cube, devices, r.seconds, 1e-12 * plan.flops / r.seconds / devices, 100 * r.busy, r.work, r.chain, r.network,
      1e-9 * r.network_bytes, r.factor_bytes / kGiB);
  std::fflush(stdout);
  nlohmann::json row =
      measure::empty_row(fmt::format("elasticity {}", cube), fmt::format("simulated on {} GPUs", devices),
                         "Espalier, tree in virtual time");
  row["refactorization"] = measure::samples_record({{r.seconds}});
  row["unknowns"] = 3 * static_cast<double>(tree.n);
  row["flops"] = plan.flops;
  row["nonzeros_factor"] = plan.nonzeros_factor;
  row["parameters"] = {{"devices", devices}};
  row["check"] = {{"busy", r.busy},       {"work", r.work},          {"chain", r.chain},
                  {"network", r.network}, {"sent", r.network_bytes}, {"factor_bytes", r.factor_bytes}};
  return row;
}

// The plan of the rank with the largest.
void show_plans(const std::vector<plan::PlanBytes>& parts) {
  double mean = 0;
  plan::PlanBytes most;
  for (const plan::PlanBytes& p : parts) {
    mean += static_cast<double>(p.all()) / static_cast<double>(parts.size());
    if (p.all() > most.all()) most = p;
  }
  const auto gib = [](Offset bytes) { return static_cast<double>(bytes) / kGiB; };
  fmt::print(
      "          plan {:.4f} GiB at most ({:.4f} on average): entries {:.4f}, rows {:.4f}, tiles {:.4f}, tasks {:.4f}, "
      "the tree {:.4f}\n",
      gib(most.all()), mean / kGiB, gib(most.entries), gib(most.rows), gib(most.tiles), gib(most.tasks),
      gib(most.tree));
}

// What ranks on processors keep: parts of factor and plan, pattern and values whole.
void show_ranks(int cube, const SparseMatrix& a, const analysis::AssemblyTree& tree, const Settings& s) {
  const double entries = 4.5 * static_cast<double>(a.row_ind.size()) + 1.5 * a.rows;  // lower triangle of 3 x 3 blocks
  // Indices and values, whole on each; index by rows and scaled values.
  const double matrix = 12 * entries + 16 * 3.0 * a.rows, shared = (12 + 8) * entries;
  for (const int ranks : s.ranks) {
    plan::PlanOptions options;
    options.devices = options.ranks = ranks;
    options.stealing = false;
    options.balance_columns = true;
    options.additional_subtrees = 0;
    const plan::Plan plan = plan_of_tree(tree, 3, options);
    double most = 0, top = 0, mean = 0;
    for (const KeptFactor& k : kept_factors(plan)) {
      mean += (k.subtrees + k.top) / ranks;
      if (k.subtrees + k.top <= most) continue;
      most = k.subtrees + k.top;
      top = k.top;
    }
    fmt::print(
        "{:>5}^3 {:>3} ranks: factor {:>7.3f} GiB at most ({:.3f} on average), {:.3f} of it the top; matrix {:.3f} GiB "
        "on each, {:.3f} of its index and scaled values\n",
        cube, ranks, most / kGiB, mean / kGiB, top / kGiB, matrix / kGiB, shared / ranks / kGiB);
    show_plans(planned_bytes(plan, a, tree, 3));
    std::fflush(stdout);
  }
}

void run(Settings s) {
  if (s.counts.empty() && s.ranks.empty()) s.counts = {8, 16, 32, 64, 128, 256, 512, 1024};
  for (const int devices : s.counts)
    if (devices > s.rates.per_machine && devices % s.rates.per_machine != 0)
      throw Error(StatusCode::invalid_input, fmt::format("--counts {}: give whole machines of {} GPUs, or part of one",
                                                         devices, s.rates.per_machine));
  base::ThreadPool pool{s.threads};
  nlohmann::json document = measure::new_document({"simulated", s.command, "", nlohmann::json::object()});
  for (const int cube : s.cubes) {
    const SparseMatrix a = brick_nodes(cube);
    const auto tree = analysis::build_tree(analysis::graph_of(a, pool), {}, pool);
    for (const int devices : s.counts) document["rows"].push_back(show_run(cube, devices, tree, s));
    if (!s.ranks.empty()) show_ranks(cube, a, tree, s);
    if (!s.out.empty()) measure::write_document(document, s.out);
  }
}

}  // namespace
}  // namespace espalier::bench

int main(int argc, char** argv) {
  espalier::bench::Settings s;
  CLI::App app{"elasticity on cubes, planned for clusters of H200s and for ranks"};
  app.add_option("cubes", s.cubes, "bricks along an edge (default 96 128 160)")->check(CLI::Range(2, 400));
  app.add_option("--counts", s.counts, "GPUs (default 8 to 1024)")->delimiter(',')->check(CLI::Range(1, 4096));
  app.add_option("--ranks", s.ranks, "what ranks on processors keep")->delimiter(',')->check(CLI::Range(1, 4096));
  app.add_option("--per-machine", s.rates.per_machine, "GPUs of a machine")->check(CLI::Range(1, 4096));
  app.add_option("--network", s.rates.network, "bytes per second of a GPU's interface, each way")
      ->check(CLI::PositiveNumber);
  app.add_option("--network-hop", s.rates.network_hop, "seconds")->check(CLI::NonNegativeNumber);
  app.add_flag("--relay", s.rates.relay, "machines pass panels on, along a binary tree");
  app.add_option("--threads", s.threads, "of the ordering")->check(CLI::Range(1, 4096));
  app.add_option("--out", s.out, "results as JSON");
  CLI11_PARSE(app, argc, argv);
  for (int k = 0; k < argc; ++k) s.command += (k > 0 ? " " : "") + std::string(argv[k]);
  try {
    espalier::bench::run(s);
  } catch (const std::exception& error) {
    fmt::print(stderr, "espalier_cluster_plan: {}\n", error.what());
    return 1;
  }
  return 0;
}

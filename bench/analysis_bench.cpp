// Times of the analysis by phase, and its flops beside METIS_NodeND's on the same compressed graph.
//   analysis_bench [threads] [system ...]     systems: "poisson 22", "kkt 20" ... as
// `espalier generate` has them, or files
// One line per system for people; figures are those of one run; processor time where there is one thread.
#include <fmt/format.h>
#include <metis.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <string>
#include <vector>

#include "analysis/fronts.hpp"
#include "analysis/matching.hpp"
#include "analysis/ordering.hpp"
#include "analysis/symbolic.hpp"
#include "rivals/systems.hpp"

using namespace espalier;
using namespace espalier::analysis;

namespace {

bool g_cpu_time = false;  // with one thread: its processor time, which a busy machine disturbs less

double now() {
  timespec t{};
  clock_gettime(g_cpu_time ? CLOCK_PROCESS_CPUTIME_ID : CLOCK_MONOTONIC, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

std::vector<Index> metis_order(const CompressedGraph& c) {
  std::vector<idx_t> ptr(c.graph.ptr.begin(), c.graph.ptr.end()), adj(c.graph.adj.begin(), c.graph.adj.end()),
      weight(c.weight);
  std::vector<idx_t> order(c.weight.size()), position(c.weight.size());
  idx_t n = c.graph.n;
  METIS_NodeND(&n, ptr.data(), adj.data(), weight.data(), nullptr, order.data(), position.data());
  return order;
}

/// The largest share of all flops on a way from a leaf to the root: what no number of devices divides, tree by tree.
double critical_share(const AssemblyTree& tree) {
  std::vector<double> below(static_cast<std::size_t>(tree.fronts()), 0);
  double all = 0, longest = 0;
  for (Index f = 0; f < tree.fronts(); ++f) {
    const auto k = static_cast<std::size_t>(f);
    const double mine = front_flops(tree.pivots(f), static_cast<double>(tree.rows_below(f)));
    all += mine;
    const double way = below[k] + mine;
    longest = std::max(longest, way);
    if (const Index p = tree.parent[k]; p >= 0)
      below[static_cast<std::size_t>(p)] = std::max(below[static_cast<std::size_t>(p)], way);
  }
  return longest / all;
}

/// Phases of our analysis; one run of METIS_NodeND with its own seed beside it.
void measure(const std::string& words, base::ThreadPool& pool) {
  const SparseMatrix a = bench::make_system(words);
  const double t0 = now();
  SymmetricMatching matching;
  if (bench::automatic_kind(a) == Kind::ldlt) matching = symmetric_matching(a, pool);
  const double t1 = now();
  const Graph graph = graph_of(a, pool);
  const double t2 = now();
  const CompressedGraph c = compress(graph, matching.pair, pool);
  const double t3 = now();
  TreeStatistics ours, metis;
  TreeOptions options;
  options.pair = matching.pair;
  const AssemblyTree tree = build_tree(graph, options, pool, &ours);
  const double t4 = now();
  const std::vector<Index> rival = metis_order(c);
  const double t5 = now();
  symbolic_tree(c, rival, pool, metis);
  fmt::print(
      "{:20} n {:8} vertices {:7} | match {:.3f} graph {:.3f} order and tree {:.3f} sum {:.3f} s "
      "(NodeND {:.3f}) | flops/NodeND {:.3f} exact {:.3e} with zeros {:.3e} (x {:.2f}, NodeND's x {:.2f}) | "
      "nnz(L) {:.3e} fronts {} critical path {:.3f}\n",
      words, a.cols, c.graph.n, t1 - t0, t2 - t1, t4 - t3, t2 - t0 + t4 - t3, t5 - t4,
      ours.flops_exact / metis.flops_exact, ours.flops_exact, ours.flops, ours.flops / ours.flops_exact,
      metis.flops / metis.flops_exact, static_cast<double>(ours.nonzeros_factor), tree.fronts(), critical_share(tree));
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  base::ThreadPool pool(argc > 1 ? std::atoi(argv[1]) : base::available_cores());
  g_cpu_time = pool.size() == 1;
  std::vector<std::string> systems(argv + std::min(argc, 2), argv + argc);
  if (systems.empty())
    systems = {"elasticity 20", "plate 200", "kkt 20", "poisson 22", "poisson 50", "poisson 300 300 1"};
  for (const auto& s : systems) measure(s, pool);
  return 0;
}

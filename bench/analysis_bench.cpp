// Times of the analysis by phase, and its flops beside METIS_NodeND's on the same compressed graph.
//   analysis_bench [threads] [system ...]     systems: elas:N plate:N kkt:B,NX,NY,NZ
// One line per system for people; figures are those of one run; processor time where there is one thread.
#include <fmt/format.h>
#include <metis.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <numeric>
#include <random>
#include <string>
#include <vector>

#include "analysis/dissection.hpp"
#include "analysis/matching.hpp"
#include "analysis/ordering.hpp"
#include "analysis/symbolic.hpp"

using namespace espalier;
using namespace espalier::analysis;

namespace {

bool g_cpu_time = false;  // with one thread: its processor time, which a busy machine disturbs less

double now() {
  timespec t{};
  clock_gettime(g_cpu_time ? CLOCK_PROCESS_CPUTIME_ID : CLOCK_MONOTONIC, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

/// Free nodes of a box of hex8 elements (x > 0), three unknowns each, lower triangle, optionally a chain of bodies with
/// multipliers. Values are those of a weighted Laplacian: positive definite in the bodies.
struct System {
  Index bodies = 1, nx = 0, ny = 0, nz = 0;
  bool clamped = true;  // the plane x == 0 is missing
  bool multipliers = false;
};

SparseMatrix generate(const System& s) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> value(0.5, 1.5);
  const Index px = s.clamped ? s.nx : s.nx + 1, py = s.ny + 1, pz = s.nz + 1;
  const Index nodes = px * py * pz, all = nodes * s.bodies;
  std::vector<Index> name(static_cast<std::size_t>(all));
  std::iota(name.begin(), name.end(), 0);
  std::shuffle(name.begin(), name.end(), random);
  const Index n = 3 * all + (s.multipliers ? 3 * s.bodies : 0);
  std::vector<std::vector<std::pair<Index, double>>> columns(static_cast<std::size_t>(n));
  const auto add = [&](Index i, Index j, double v) {
    columns[static_cast<std::size_t>(std::min(i, j))].emplace_back(std::max(i, j), v);
  };
  for (Index body = 0; body < s.bodies; ++body)
    for (Index p = 0; p < nodes; ++p) {
      const Index x = p % px, y = p / px % py, z = p / px / py;
      for (Index c = std::max(0, z - 1); c <= std::min(pz - 1, z + 1); ++c)
        for (Index b = std::max(0, y - 1); b <= std::min(py - 1, y + 1); ++b)
          for (Index a = std::max(0, x - 1); a <= std::min(px - 1, x + 1); ++a) {
            const Index q = (c * py + b) * px + a;
            if (q < p) continue;
            const Index u = name[static_cast<std::size_t>(body * nodes + p)],
                        v = name[static_cast<std::size_t>(body * nodes + q)];
            for (Index d = 0; d < 3; ++d)
              for (Index e = 0; e < 3; ++e) {
                if (q == p && e < d) continue;
                add(3 * u + d, 3 * v + e, q == p && d == e ? 12 + value(random) : -0.15 * value(random));
              }
          }
    }
  for (Index body = 0; s.multipliers && body < s.bodies; ++body)
    for (Index yz = 0; yz < py * pz; ++yz)
      for (Index d = 0; d < 3; ++d) {
        const Index row = 3 * all + 3 * body + d;
        add(row, 3 * name[static_cast<std::size_t>(body * nodes + yz * px)] + d, 1.0 / (py * pz));
        if (body > 0)
          add(row, 3 * name[static_cast<std::size_t>((body - 1) * nodes + yz * px + px - 1)] + d, -1.0 / (py * pz));
      }
  SparseMatrix m{n, n, {0}, {}, {}, Storage::symmetric_lower};
  for (auto& column : columns) {
    std::sort(column.begin(), column.end());
    for (const auto& [i, v] : column) {
      m.row_ind.push_back(i);
      m.values.push_back(v);
    }
    m.col_ptr.push_back(static_cast<Offset>(m.row_ind.size()));
  }
  return m;
}

std::vector<Index> metis_order(const CompressedGraph& c) {
  std::vector<idx_t> ptr(c.graph.ptr.begin(), c.graph.ptr.end()), adj(c.graph.adj.begin(), c.graph.adj.end()),
      weight(c.weight);
  std::vector<idx_t> order(c.weight.size()), position(c.weight.size());
  idx_t n = c.graph.n;
  METIS_NodeND(&n, ptr.data(), adj.data(), weight.data(), nullptr, order.data(), position.data());
  return order;
}

void measure(const std::string& name, const System& s, base::ThreadPool& pool) {
  const SparseMatrix a = generate(s);
  const double t0 = now();
  SymmetricMatching matching;
  if (s.multipliers) matching = symmetric_matching(a, pool);
  const double t1 = now();
  const Graph graph = graph_of(a, pool);
  const double t2 = now();
  const CompressedGraph c = compress(graph, matching.pair, pool);
  const double t3 = now();
  const std::vector<Index> order = nested_dissection(c, pool);
  const double t4 = now();
  TreeStatistics ours, metis;
  const AssemblyTree tree = symbolic_tree(c, order, pool, ours);
  const double t5 = now();
  const std::vector<Index> rival = metis_order(c);
  const double t6 = now();
  symbolic_tree(c, rival, pool, metis);
  fmt::print(
      "{:14} n {:8} vertices {:7} | match {:.3f} graph {:.3f} compress {:.3f} dissect {:.3f} symbolic {:.3f} sum "
      "{:.3f} s (NodeND "
      "{:.3f}) | flops {:.3e} exact {:.3e} NodeND {:.3e} ratio {:.3f} | nnz(L) {:.3e} fronts {}\n",
      name, a.cols, c.graph.n, t1 - t0, t2 - t1, t3 - t2, t4 - t3, t5 - t4, t5 - t0, t6 - t5, ours.flops,
      ours.flops_exact, metis.flops_exact, ours.flops_exact / metis.flops_exact,
      static_cast<double>(ours.nonzeros_factor), tree.fronts());
  std::fflush(stdout);
}

System parse(const std::string& text) {
  std::vector<int> k;
  for (std::size_t p = text.find(':'); p != std::string::npos; p = text.find(',', p + 1))
    k.push_back(std::atoi(text.c_str() + p + 1));
  if (text.starts_with("elas")) return {1, k.at(0), k.at(0), k.at(0), true, false};
  if (text.starts_with("plate")) return {1, k.at(0), k.at(0), 1, true, false};
  return {k.at(0), k.at(1), k.at(2), k.at(3), false, true};
}

}  // namespace

int main(int argc, char** argv) {
  base::ThreadPool pool(argc > 1 ? std::atoi(argv[1]) : base::available_cores());
  g_cpu_time = pool.size() == 1;
  std::vector<std::string> systems(argv + std::min(argc, 2), argv + argc);
  if (systems.empty()) systems = {"elas:20", "plate:200", "kkt:20,20,8,8", "elas:40"};
  for (const auto& s : systems) measure(s, parse(s), pool);
  return 0;
}

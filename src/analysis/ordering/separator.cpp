#include "analysis/ordering/separator.hpp"

#include <algorithm>
#include <array>
#include <vector>

#include "analysis/ordering/bisection.hpp"
#include "base/at.hpp"

namespace espalier::analysis {

namespace {

constexpr Index kCoarsest = 120;   // vertices of the coarsest graph
constexpr int kGrowths = 4;        // starts on the coarsest graph; 8 and 16 gained nothing on the mean of six graphs
constexpr int kPasses = 8;         // most passes of refinement on a level
constexpr double kMostSide = 0.6;  // of the whole weight, in one side
constexpr Index kOneRun = 4000;    // graphs below get one multilevel run ...
constexpr Index kBranch = 5000;    // ... others are coarsened to about this size, from where several runs start,
constexpr Index kShrink = 16;      // and at least by this factor (METIS: 16; 8 gave 3 % more flops on scalar grids)
constexpr int kRuns = 4;

Offset most_side(const PartGraph& g) { return static_cast<Offset>(kMostSide * static_cast<double>(g.total)) + 1; }

/// The boundary of one side, the lighter of the two boundaries, becomes the separator.
Separation separation_of(const PartGraph& g, const Bisection& b) {
  Offset boundary[2] = {0, 0};
  std::vector<char> at_boundary(at(g.n()), 0);
  for (Index v = 0; v < g.n(); ++v)
    for (Offset e = g.ptr[at(v)]; e < g.ptr[at(v) + 1]; ++e)
      if (b.side[at(g.adj[at(e)])] != b.side[at(v)]) {
        at_boundary[at(v)] = 1;
        boundary[b.side[at(v)] != 0 ? 1 : 0] += g.weight[at(v)];
        break;
      }
  const int taken = boundary[1] < boundary[0] ? 1 : 0;
  Separation s{b.side, {b.weight[0], b.weight[1], boundary[taken]}};
  s.weight[at(taken)] -= boundary[taken];
  for (std::size_t v = 0; v < s.side.size(); ++v)
    if (at_boundary[v] != 0 && s.side[v] == taken) s.side[v] = 2;
  return s;
}

Separation separate_coarsest(const PartGraph& g, Random& random) {
  Bisection best;
  for (int k = 0; k < kGrowths; ++k) {
    Bisection b = grow_bisection(g, random);
    refine(g, most_side(g), kPasses, b);
    if (k == 0 || b.cut < best.cut) best = std::move(b);
  }
  Separation s = separation_of(g, best);
  refine(g, most_side(g), kPasses, s);
  return s;
}

Separation project(const Separation& coarse, const std::vector<Index>& map, base::Recursion& workers) {
  constexpr std::int64_t kVertices = 1 << 16;
  Separation fine{std::vector<char>(map.size()), coarse.weight};
  workers.for_each_range(static_cast<std::int64_t>(map.size()), kVertices, [&](std::int64_t begin, std::int64_t end) {
    for (auto v = at(begin); v < at(end); ++v) fine.side[v] = coarse.side[at(map[v])];
  });
  return fine;
}

/// Coarsens down to `coarsest` vertices or until it no longer pays; level 0 is the coarse graph of `g`.
std::vector<Coarser> coarsen_to(const PartGraph& g, Index coarsest, Random& random, base::Recursion& workers) {
  std::vector<Coarser> levels;
  const PartGraph* finest = &g;
  // No vertex may become so heavy that the coarsest graph cannot be halved.
  const Offset most = 3 * g.total / (2 * kCoarsest) + 1;
  while (finest->n() > coarsest) {
    Coarser next = coarsen(*finest, most, random, workers);
    const bool pays = next.graph.n() < 0.95 * finest->n();
    levels.push_back(std::move(next));
    finest = &levels.back().graph;
    if (!pays) break;
  }
  return levels;
}

template <class Solve>
Separation multilevel(const PartGraph& g, Index coarsest, Random& random, base::Recursion& workers,
                      const Solve& solve) {
  const std::vector<Coarser> levels = coarsen_to(g, coarsest, random, workers);
  Separation s = solve(levels.empty() ? g : levels.back().graph);
  for (std::size_t k = levels.size(); k-- > 0;) {
    s = project(s, levels[k].map, workers);
    const PartGraph& graph = k == 0 ? g : levels[k - 1].graph;
    refine(graph, most_side(graph), kPasses, s);
  }
  return s;
}

Separation one_run(const PartGraph& g, Random& random, base::Recursion& workers) {
  return multilevel(g, kCoarsest, random, workers,
                    [&](const PartGraph& coarsest) { return separate_coarsest(coarsest, random); });
}

/// The best of several runs, side by side; the first among equals.
Separation best_of_runs(const PartGraph& g, Random& random, base::Recursion& workers) {
  std::array<Separation, kRuns> runs;
  std::array<std::uint64_t, kRuns> seeds;
  for (std::uint64_t& seed : seeds) seed = random.next();
  workers.for_each_range(kRuns, 1, [&](std::int64_t k, std::int64_t) {
    Random mine(seeds[at(k)]);
    runs[at(k)] = one_run(g, mine, workers);
  });
  return std::move(
      *std::min_element(runs.begin(), runs.end(), [](const auto& a, const auto& b) { return score(a) < score(b); }));
}

}  // namespace

Separation find_separator(const PartGraph& graph, std::uint64_t seed, base::Recursion& workers) {
  Random random(seed);
  if (graph.n() < kOneRun) return one_run(graph, random, workers);
  return multilevel(graph, std::min(kBranch, graph.n() / kShrink), random, workers,
                    [&](const PartGraph& branch) { return best_of_runs(branch, random, workers); });
}

}  // namespace espalier::analysis

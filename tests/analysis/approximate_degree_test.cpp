// Approximate minimum degree. The truth is a dense elimination in the order that it gives, and exact minimum degree.
#include "analysis/ordering/approximate_degree.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>
#include <vector>

#include "analysis/ordering.hpp"
#include "analysis/ordering/dissection.hpp"
#include "analysis/symbolic.hpp"
#include "graphs.hpp"

namespace espalier::analysis {
namespace {

using namespace testing;

PartGraph part_of(const Graph& g, const std::vector<Index>& weight) {
  PartGraph p;
  p.ptr = g.ptr;
  p.adj = g.adj;
  p.weight = weight;
  p.total = std::accumulate(weight.begin(), weight.end(), Offset{0});
  return p;
}

using Pattern = std::vector<std::vector<char>>;

Pattern dense(const Graph& g) {
  const auto n = static_cast<std::size_t>(g.n);
  Pattern a(n, std::vector<char>(n, 0));
  for (Index v = 0; v < g.n; ++v)
    for (const Index u : g.neighbours(v)) a[static_cast<std::size_t>(v)][static_cast<std::size_t>(u)] = 1;
  return a;
}

// Takes v out; its neighbours are joined to each other. @returns the flops of its columns
double eliminate(Pattern& a, std::size_t v, const std::vector<Index>& weight) {
  std::vector<std::size_t> around;
  double d = 0;
  for (std::size_t u = 0; u < a.size(); ++u)
    if (a[v][u] != 0) {
      around.push_back(u);
      d += weight[u];
    }
  for (const std::size_t u : around) {
    for (const std::size_t w : around)
      if (w != u) a[u][w] = 1;
    a[u][v] = a[v][u] = 0;
  }
  const double k = weight[v];
  return k * k * k / 3 + k * k * d + k * d * d;
}

// The operations of the first `inner` vertices.
double exact_minimum_degree_flops(const Graph& g, const std::vector<Index>& weight, std::size_t inner) {
  Pattern a = dense(g);
  std::vector<char> gone(a.size(), 0);
  double flops = 0;
  for (std::size_t step = 0; step < inner; ++step) {
    std::size_t best = a.size();
    Offset least = 0;
    for (std::size_t v = 0; v < inner; ++v) {
      if (gone[v] != 0) continue;
      Offset degree = 0;
      for (std::size_t u = 0; u < a.size(); ++u) degree += a[v][u] != 0 ? weight[u] : 0;
      if (best == a.size() || degree < least) {
        best = v;
        least = degree;
      }
    }
    gone[best] = 1;
    flops += eliminate(a, best, weight);
  }
  return flops;
}

void expect_permutation(std::vector<Index> order, Index n) {
  std::sort(order.begin(), order.end());
  std::vector<Index> all(static_cast<std::size_t>(n));
  std::iota(all.begin(), all.end(), 0);
  EXPECT_EQ(order, all);
}

// On 200 random graphs, of which `inner_of` says how many vertices are to be ordered: the flops are those of a dense
// elimination, and all in all near those of the exact rule.
template <class InnerOf>
void expect_near_the_exact_rule(InnerOf&& inner_of) {
  double ours = 0, exact = 0;
  for (unsigned seed = 0; seed < 200; ++seed) {
    SCOPED_TRACE(::testing::Message() << "seed " << seed);
    std::mt19937 random(seed);
    const auto n = static_cast<Index>(1 + random() % 90), inner = inner_of(n, random);
    const Graph g = graph_of_edges(n, random_edges(n, static_cast<Index>(n * (1 + random() % 3)), random));
    std::vector<Index> weight(static_cast<std::size_t>(n));
    for (Index& w : weight) w = seed % 2 == 0 ? 1 : static_cast<Index>(1 + random() % 3);
    const PartGraph part = part_of(g, weight);
    const MinimumDegreeOrder found =
        inner == n ? approximate_minimum_degree(part) : approximate_minimum_degree(part, inner);
    expect_permutation(found.order, inner);
    Pattern a = dense(g);
    double flops = 0;
    for (const Index v : found.order) flops += eliminate(a, static_cast<std::size_t>(v), weight);
    EXPECT_NEAR(found.flops, flops, 1e-9 * flops);
    ours += flops;
    exact += exact_minimum_degree_flops(g, weight, static_cast<std::size_t>(inner));
  }
  EXPECT_LT(ours, 1.1 * exact);
}

TEST(ApproximateMinimumDegree, FlopsAreThoseOfADenseEliminationAndNearTheExactRule) {
  expect_near_the_exact_rule([](Index n, std::mt19937&) { return n; });
}

TEST(ApproximateMinimumDegree, AHaloCountsAndIsNotOrdered) {
  expect_near_the_exact_rule(
      [](Index n, std::mt19937& random) { return static_cast<Index>(1 + random() % static_cast<unsigned>(n)); });
}

TEST(ApproximateMinimumDegree, ClosedForms) {
  const auto flops = [](const Graph& g) {
    return approximate_minimum_degree(part_of(g, std::vector<Index>(static_cast<std::size_t>(g.n), 1))).flops;
  };
  // Forests have no fill: every vertex but the last of a tree has one neighbour left.
  const double leaf = 1.0 / 3 + 1 + 1, alone = 1.0 / 3;
  EXPECT_NEAR(flops(chain(500)), 499 * leaf + alone, 1e-9);
  EXPECT_NEAR(flops(star(500)), 499 * leaf + alone, 1e-9);
  EXPECT_NEAR(flops(graph_of_edges(7, {})), 7 * alone, 1e-12);
  EXPECT_NEAR(flops(complete(60)), 60.0 * 60 * 60 / 3, 1e-9);
}

TEST(ApproximateMinimumDegree, TreesAreTakenFromItWhereTheyNeedClearlyLessWork) {
  base::ThreadPool pool(2);
  int better = 0;
  for (unsigned seed = 0; seed < 40; ++seed) {
    SCOPED_TRACE(::testing::Message() << "seed " << seed);
    std::mt19937 random(seed);
    const auto n = static_cast<Index>(400 + random() % 600);
    const Graph g = graph_of_edges(n, random_edges(n, n + n / 2, random));
    const CompressedGraph compressed = compress(g, {}, pool);
    TreeStatistics dissection, taken;
    symbolic_tree(compressed, nested_dissection(compressed, pool), pool, dissection);
    build_tree(g, {}, pool, &taken);
    EXPECT_LE(taken.flops, dissection.flops);
    if (taken.flops < dissection.flops) {
      ++better;
      EXPECT_LE(taken.flops, 0.93 * dissection.flops);
    }
  }
  EXPECT_GT(better, 5);
}

// A path of `length` cliques of four, each joined to the next.
Graph ladder(Index length) {
  Edges edges;
  for (Index k = 0; k + 4 < 4 * length; ++k)
    for (Index next = k + 1; next <= k + 4; ++next) edges.emplace_back(k, next);
  return graph_of_edges(4 * length, edges);
}

// Flops are compared with those of either order.
TEST(ApproximateMinimumDegree, PlaneGraphsGoWithoutDissection) {
  base::ThreadPool pool(2);
  struct Figures {
    double taken, dissection, minimum_degree;
  };
  const auto figures = [&](const Graph& g) {
    const CompressedGraph c = compress(g, {}, pool);
    const auto flops = [&](std::vector<Index> order) {
      TreeStatistics of;
      symbolic_tree(c, std::move(order), pool, of);
      return of.flops_exact;
    };
    TreeStatistics taken;
    build_tree(g, {}, pool, &taken);
    return Figures{taken.flops_exact, flops(nested_dissection(c, pool)),
                   flops(approximate_minimum_degree(part_of(c.graph, c.weight)).order)};
  };
  for (const Index side : {20, 30, 50, 70}) {
    SCOPED_TRACE(::testing::Message() << "side " << side);
    const Figures plane = figures(axis_grid(side, side, 1));
    EXPECT_EQ(plane.taken, plane.minimum_degree);
    EXPECT_LT(plane.taken, 1.1 * plane.dissection);
  }
  // A larger plane, bodies in space, chains.
  for (const Graph& g : {axis_grid(150, 150, 1), axis_grid(8, 8, 8), axis_grid(14, 14, 14), ladder(300)}) {
    SCOPED_TRACE(::testing::Message() << g.n << " vertices");
    const Figures other = figures(g);
    EXPECT_EQ(other.taken, other.dissection);
    EXPECT_NE(other.dissection, other.minimum_degree);
  }
}

}  // namespace
}  // namespace espalier::analysis

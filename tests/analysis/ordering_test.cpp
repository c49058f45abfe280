#include "analysis/ordering.hpp"

#include <gtest/gtest.h>
#ifdef ESPALIER_TEST_METIS
#include <metis.h>
#endif

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numeric>
#include <random>

#include "analysis/relocation.hpp"
#include "analysis/symbolic.hpp"
#include "analysis/verify.hpp"
#include "graphs.hpp"

namespace espalier::analysis {
namespace {

using namespace testing;

/// Columns of L by elimination of a dense pattern in the order of the tree: the truth for fill counts.
std::vector<Index> dense_column_counts(const Graph& g, const std::vector<Index>& order) {
  const auto n = static_cast<std::size_t>(g.n);
  std::vector<std::size_t> position(n);
  for (std::size_t k = 0; k < n; ++k) position[static_cast<std::size_t>(order[k])] = k;
  std::vector<std::vector<char>> a(n, std::vector<char>(n, 0));
  for (Index v = 0; v < g.n; ++v)
    for (const Index u : g.neighbours(v))
      a[position[static_cast<std::size_t>(v)]][position[static_cast<std::size_t>(u)]] = 1;
  std::vector<Index> count(n, 1);
  for (std::size_t k = 0; k < n; ++k)
    for (std::size_t i = k + 1; i < n; ++i) {
      if (a[i][k] == 0) continue;
      ++count[k];
      for (std::size_t j = k + 1; j < n; ++j)
        if (j != i && a[j][k] != 0) a[i][j] = 1;
    }
  return count;
}

double flops_of(const std::vector<Index>& counts) {
  double sum = 0;
  for (const Index c : counts) sum += static_cast<double>(c) * c;
  return sum;
}

// Where each unknown stands in the order.
std::vector<Index> places_in(const AssemblyTree& tree) {
  std::vector<Index> place(tree.order.size());
  for (std::size_t k = 0; k < place.size(); ++k) place[static_cast<std::size_t>(tree.order[k])] = static_cast<Index>(k);
  return place;
}

Index front_of(const AssemblyTree& tree, Index position) {
  return static_cast<Index>(std::upper_bound(tree.first.begin(), tree.first.end(), position) - tree.first.begin()) - 1;
}

TEST(BuildTree, CountsAgreeWithDenseEliminationOnRandomPatterns) {
  base::ThreadPool pool(2);
  for (unsigned seed = 0; seed < 120; ++seed) {
    std::mt19937 random(seed);
    const Index n = 1 + static_cast<Index>(random() % 60);
    const Graph g =
        graph_of_edges(n, random_edges(n, static_cast<Index>(random() % (3 * static_cast<unsigned>(n))), random));
    TreeStatistics statistics;
    const AssemblyTree tree = build_tree(g, {}, pool, &statistics);
    ASSERT_EQ(verify_tree(g, tree), "") << "seed " << seed;
    EXPECT_EQ(flops_of(dense_column_counts(g, tree.order)), statistics.flops_exact) << "seed " << seed;
    Offset entries = 0;
    for (Index f = 0; f < tree.fronts(); ++f)
      entries += Offset{tree.pivots(f)} * tree.rows_below(f) + Offset{tree.pivots(f)} * (tree.pivots(f) + 1) / 2;
    EXPECT_EQ(entries, statistics.nonzeros_factor) << "seed " << seed;
    EXPECT_GE(statistics.flops, statistics.flops_exact) << "seed " << seed;
  }
}

TEST(BuildTree, ClosedForms) {
  base::ThreadPool pool(2);
  TreeStatistics s;
  // A chain of n fills nothing in a nested order of vertices of degree 2 beyond one entry per inner vertex: every
  // elimination order costs at least 2 entries per column but the last.
  ASSERT_EQ(verify_tree(chain(1000), build_tree(chain(1000), {}, pool, &s)), "");
  EXPECT_GE(s.flops_exact, 4.0 * 999 + 1);
  EXPECT_LE(s.flops_exact, 9.0 * 1000);
  // A star: the leaves go first, two entries per column.
  ASSERT_EQ(verify_tree(star(500), build_tree(star(500), {}, pool, &s)), "");
  EXPECT_EQ(s.flops_exact, 4.0 * 499 + 1);
  // A complete graph: one dense front.
  const AssemblyTree full = build_tree(complete(40), {}, pool, &s);
  EXPECT_EQ(full.fronts(), 1);
  EXPECT_EQ(full.pivots(0), 40);
  EXPECT_EQ(s.flops, 40.0 * 41 * 81 / 6);
  EXPECT_EQ(s.nonzeros_factor, 40 * 41 / 2);
}

TEST(BuildTree, EmptySingleAndDiagonal) {
  base::ThreadPool pool(2);
  const AssemblyTree none = build_tree(graph_of_edges(0, {}), {}, pool);
  EXPECT_EQ(none.n, 0);
  EXPECT_EQ(none.fronts(), 0);
  const AssemblyTree one = build_tree(graph_of_edges(1, {}), {}, pool);
  EXPECT_EQ(verify_tree(graph_of_edges(1, {}), one), "");
  EXPECT_EQ(one.fronts(), 1);
  const Graph diagonal = graph_of_edges(1000000, {});
  EXPECT_EQ(verify_tree(diagonal, build_tree(diagonal, {}, pool)), "");
}

TEST(BuildTree, DenseRowGoesLast) {
  base::ThreadPool pool(2);
  const Index n = 40000;
  Edges e;
  for (Index k = 1; k < n; ++k) e.emplace_back(0, k);
  for (Index k = 2; k < n; ++k) e.emplace_back(k - 1, k);
  const Graph g = graph_of_edges(n, e);
  TreeStatistics s;
  const AssemblyTree tree = build_tree(g, {}, pool, &s);
  ASSERT_EQ(verify_tree(g, tree), "");
  EXPECT_EQ(tree.order.back(), 0);
  EXPECT_LE(s.flops_exact, 16.0 * n);  // a chain with one more entry per column
}

TEST(BuildTree, DisconnectedPartsKeepTheirFill) {
  base::ThreadPool pool(2);
  const Graph one = brick(12, 12, 12, 1);
  Edges e;
  for (Index c = 0; c < 3; ++c)
    for (Index v = 0; v < one.n; ++v)
      for (const Index u : one.neighbours(v)) e.emplace_back(3 * u + c, 3 * v + c);
  const Graph three = graph_of_edges(3 * one.n, e);
  TreeStatistics s1, s3;
  build_tree(one, {}, pool, &s1);
  ASSERT_EQ(verify_tree(three, build_tree(three, {}, pool, &s3)), "");
  EXPECT_LE(s3.flops_exact, 3.3 * s1.flops_exact);  // other seeds, a tenth to spare
}

TEST(BuildTree, SameForEveryNumberOfThreads) {
  for (const Graph& g : {brick(24, 20, 16, 3), brick(70, 60, 1, 2), star(3000)}) {
    AssemblyTree first;
    for (const int threads : {1, 2, 4}) {
      base::ThreadPool pool(threads);
      for (int repeat = 0; repeat < 2; ++repeat) {
        const AssemblyTree tree = build_tree(g, {}, pool);
        if (first.n == 0) first = tree;
        ASSERT_EQ(tree.order, first.order) << threads << " threads";
        ASSERT_EQ(tree.first, first.first);
        ASSERT_EQ(tree.parent, first.parent);
        ASSERT_EQ(tree.row_ptr, first.row_ptr);
        ASSERT_EQ(tree.rows, first.rows);
      }
    }
  }
}

#ifdef ESPALIER_TEST_METIS
TreeStatistics metis_statistics(const Graph& g, base::ThreadPool& pool) {
  const CompressedGraph c = compress(g, {}, pool);
  std::vector<idx_t> ptr(c.graph.ptr.begin(), c.graph.ptr.end()), adj(c.graph.adj.begin(), c.graph.adj.end());
  std::vector<idx_t> weight(c.weight), order(c.weight.size()), position(c.weight.size());
  idx_t n = c.graph.n;
  EXPECT_EQ(METIS_NodeND(&n, ptr.data(), adj.data(), weight.data(), nullptr, order.data(), position.data()), METIS_OK);
  TreeStatistics metis;
  symbolic_tree(c, order, pool, metis);
  return metis;
}
#endif

TEST(BuildTree, NeedsNoMoreWorkThanMetis) {
#ifndef ESPALIER_TEST_METIS
  GTEST_SKIP() << "METIS was not found";
#else
  base::ThreadPool pool(2);
  for (const Graph& g : {brick(20, 21, 21, 3), brick(120, 121, 2, 3), brick(60, 12, 12, 3)}) {
    TreeStatistics ours;
    ASSERT_EQ(verify_tree(g, build_tree(g, {}, pool, &ours)), "");
    EXPECT_LE(ours.flops_exact, 1.03 * metis_statistics(g, pool).flops_exact);  // the bound that the project sets
    EXPECT_LE(ours.flops, 1.1 * ours.flops_exact);  // what amalgamation may add on systems of this size
  }
#endif
}

// Bounds of the project: 1.03 in the geometric mean, 1.1 anywhere.
TEST(BuildTree, ScalarGridsNeedNoMoreWorkThanMetis) {
#ifndef ESPALIER_TEST_METIS
  GTEST_SKIP() << "METIS was not found";
#else
  base::ThreadPool pool(2);
  const std::vector<Graph> grids = {axis_grid(22, 22, 22), axis_grid(30, 30, 30), axis_grid(100, 20, 15),
                                    axis_grid(120, 120, 1), axis_grid(300, 300, 1)};
  double logs = 0;
  for (const Graph& g : grids) {
    TreeStatistics ours;
    ASSERT_EQ(verify_tree(g, build_tree(g, {}, pool, &ours)), "");
    const double ratio = ours.flops_exact / metis_statistics(g, pool).flops_exact;
    EXPECT_LE(ratio, 1.1) << "n = " << g.n;
    logs += std::log(ratio);
  }
  EXPECT_LE(std::exp(logs / static_cast<double>(grids.size())), 1.03);
#endif
}

TEST(BuildTree, CallersPermutation) {
  base::ThreadPool pool(2);
  for (unsigned seed = 0; seed < 40; ++seed) {
    std::mt19937 random(seed);
    const Index n = 1 + static_cast<Index>(random() % 50);
    const Graph g = graph_of_edges(n, random_edges(n, 2 * n, random));
    std::vector<Index> order(static_cast<std::size_t>(n));
    std::iota(order.begin(), order.end(), 0);
    std::shuffle(order.begin(), order.end(), random);
    TreeOptions options;
    options.permutation = order;
    TreeStatistics s;
    ASSERT_EQ(verify_tree(g, build_tree(g, options, pool, &s)), "") << "seed " << seed;
    EXPECT_EQ(s.flops_exact, flops_of(dense_column_counts(g, order))) << "seed " << seed;
  }
  const std::vector<Index> wrong{0, 2, 2};
  TreeOptions options;
  options.permutation = wrong;
  EXPECT_THROW(build_tree(chain(3), options, pool), Error);
  EXPECT_THROW(build_tree(chain(4), options, pool), Error);
}

TEST(BuildTree, PairsShareAFront) {
  base::ThreadPool pool(2);
  for (unsigned seed = 0; seed < 60; ++seed) {
    std::mt19937 random(seed);
    const Index n = 20 + static_cast<Index>(random() % 400);
    const Graph g = graph_of_edges(n, random_edges(n, 2 * n, random));
    std::vector<Index> pair(static_cast<std::size_t>(n));
    std::iota(pair.begin(), pair.end(), 0);
    for (Index v = 0; v < n; ++v)
      for (const Index u : g.neighbours(v))
        if (pair[static_cast<std::size_t>(v)] == v && pair[static_cast<std::size_t>(u)] == u && random() % 2 == 0)
          std::swap(pair[static_cast<std::size_t>(v)], pair[static_cast<std::size_t>(u)]);
    std::vector<Index> own(static_cast<std::size_t>(n));
    std::iota(own.begin(), own.end(), 0);
    std::shuffle(own.begin(), own.end(), random);
    TreeOptions options;
    options.pair = pair;
    if (seed % 2 == 0) options.permutation = own;
    const AssemblyTree tree = build_tree(g, options, pool);
    ASSERT_EQ(verify_tree(g, tree), "") << "seed " << seed;
    const std::vector<Index> position = places_in(tree);
    for (std::size_t v = 0; v < pair.size(); ++v) {
      const Index a = position[v], b = position[static_cast<std::size_t>(pair[v])];
      EXPECT_LE(std::abs(a - b), 1) << "seed " << seed;
      EXPECT_EQ(front_of(tree, a), front_of(tree, b)) << "seed " << seed;
    }
  }
}

TEST(BuildTree, MultipliersComeAfterWhatTheyTouch) {
  base::ThreadPool pool(2);
  for (unsigned seed = 0; seed < 60; ++seed) {
    std::mt19937 random(seed);
    const Index n = 30 + static_cast<Index>(random() % 500), multipliers = n / 6;
    Edges e = random_edges(n - multipliers, 2 * n, random);
    for (Index m = n - multipliers; m < n; ++m)
      for (int k = 0; k < 4; ++k)
        e.emplace_back(m, static_cast<Index>(random() % static_cast<unsigned>(n - multipliers)));
    const Graph g = graph_of_edges(n, e);
    std::vector<char> zero(static_cast<std::size_t>(n), 0);
    std::fill(zero.end() - multipliers, zero.end(), 1);
    TreeOptions options;
    options.zero_diagonal = zero;
    const AssemblyTree tree = build_tree(g, options, pool);
    ASSERT_EQ(verify_tree(g, tree), "") << "seed " << seed;
    const std::vector<Index> position = places_in(tree);
    for (Index m = n - multipliers; m < n; ++m)
      for (const Index u : g.neighbours(m)) {
        const Index a = position[static_cast<std::size_t>(m)], b = position[static_cast<std::size_t>(u)];
        EXPECT_TRUE(a > b || front_of(tree, a) == front_of(tree, b)) << "seed " << seed << " multiplier " << m;
      }
  }
}

// Three rounds of moves in each of 150 random trees. choose(tree, seed, round, random) gives the moves, and
// check(moves, tree before, tree after, place of every unknown after) sees what came of them.
// @returns fronts that vanished
template <class Choose, class Check>
int relocate_in_random_trees(Choose&& choose, Check&& check) {
  base::ThreadPool pool(2);
  int vanished = 0;
  for (unsigned seed = 0; seed < 150; ++seed) {
    std::mt19937 random(seed);
    const Index n = 2 + static_cast<Index>(random() % 300);
    const Graph g = graph_of_edges(n, random_edges(n, n + n / 2, random));
    AssemblyTree tree = build_tree(g, {}, pool);
    for (int round = 0; round < 3; ++round) {
      SCOPED_TRACE(::testing::Message() << "seed " << seed << " round " << round);
      const AssemblyTree before = tree;
      const std::vector<PivotMove> moves = choose(before, seed, round, random);
      relocate_pivots(tree, moves);
      EXPECT_EQ(verify_tree(g, tree), "");
      vanished += before.fronts() - tree.fronts();
      check(moves, before, tree, places_in(tree));
      if (::testing::Test::HasFailure()) return vanished;
    }
  }
  return vanished;
}

TEST(RelocatePivots, TreeStaysValidAndColumnsMoveOneFrontUp) {
  int moved_up = 0;
  std::vector<Index> positions;
  const auto choose = [&](const AssemblyTree& before, unsigned seed, int round, std::mt19937& random) {
    positions.clear();
    for (Index p = 0; p < before.n; ++p)
      if (random() % (2 + seed % 9) == 0 || (round == 1 && front_of(before, p) % 3 == 0)) positions.push_back(p);
    return one_front_up(before, positions);
  };
  // A pivot now shares a front with the old parent's last pivot that stayed, and stands behind all of those.
  const auto check = [&](const std::vector<PivotMove>&, const AssemblyTree& before, const AssemblyTree& tree,
                         const std::vector<Index>& place) {
    const auto now = [&](Index p) {
      return place[static_cast<std::size_t>(before.order[static_cast<std::size_t>(p)])];
    };
    for (const Index p : positions) {
      const Index f = front_of(before, p), parent = before.parent[static_cast<std::size_t>(f)];
      const auto home = static_cast<std::size_t>(parent < 0 ? f : parent);
      moved_up += parent >= 0 ? 1 : 0;
      for (Index q = before.first[home]; q < before.first[home + 1]; ++q) {
        if (std::find(positions.begin(), positions.end(), q) != positions.end()) continue;
        ASSERT_EQ(front_of(tree, now(p)), front_of(tree, now(q)));
        ASSERT_GT(now(p), now(q));
      }
    }
  };
  EXPECT_GT(relocate_in_random_trees(choose, check), 10);
  EXPECT_GT(moved_up, 100);
}

TEST(RelocatePivots, TreeStaysValidWhateverAncestorAColumnMovesTo) {
  int far = 0;
  const auto choose = [&](const AssemblyTree& before, unsigned seed, int round, std::mt19937& random) {
    std::vector<PivotMove> moves;
    for (Index p = 0; p < before.n; ++p) {
      Index f = front_of(before, p);
      if (random() % (2 + seed % 9) != 0 && (round != 1 || f % 3 != 0)) continue;
      const Index start = f;
      if (round == 1 && f % 3 == 0 && before.parent[static_cast<std::size_t>(f)] >= 0)
        f = before.parent[static_cast<std::size_t>(f)];
      while (before.parent[static_cast<std::size_t>(f)] >= 0 && random() % 3 != 0)
        f = before.parent[static_cast<std::size_t>(f)];
      far += f != start && f != before.parent[static_cast<std::size_t>(start)] ? 1 : 0;
      moves.push_back({p, f});
    }
    return moves;
  };
  const auto check = [](const std::vector<PivotMove>& moves, const AssemblyTree& before, const AssemblyTree& tree,
                        const std::vector<Index>& place) {
    std::vector<Index> of_home(static_cast<std::size_t>(before.fronts()), -1);  // front by the one before
    for (const PivotMove& m : moves) {
      Index& home = of_home[static_cast<std::size_t>(m.front)];
      const Index now =
          front_of(tree, place[static_cast<std::size_t>(before.order[static_cast<std::size_t>(m.position)])]);
      if (home < 0) home = now;
      ASSERT_EQ(home, now) << "what moves to one front stays together";
    }
  };
  EXPECT_GT(relocate_in_random_trees(choose, check), 10);
  EXPECT_GT(far, 100);
}

}  // namespace
}  // namespace espalier::analysis

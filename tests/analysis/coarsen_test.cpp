#include "analysis/ordering/coarsen.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <map>
#include <numeric>
#include <random>

#include "analysis/ordering/pair_matching.hpp"
#include "analysis/ordering/subgraphs.hpp"
#include "base/at.hpp"
#include "graphs.hpp"

namespace espalier::analysis {
namespace {

using namespace testing;

PartGraph part_graph(const Graph& g, std::mt19937& random) {
  PartGraph p;
  p.ptr = g.ptr;
  p.adj = g.adj;
  p.edge.resize(p.adj.size());
  p.weight.resize(at(g.n));
  for (Index v = 0; v < g.n; ++v) {
    p.total += p.weight[at(v)] = 1 + static_cast<Index>(random() % 5);
    for (Offset e = g.ptr[at(v)]; e < g.ptr[at(v) + 1]; ++e)  // the same seen from both ends
      p.edge[at(e)] = 1 + (std::min(v, g.adj[at(e)]) * 7 + std::max(v, g.adj[at(e)]) * 13) % 4;
  }
  return p;
}

/// A mesh with shuffled names, large enough to be matched in rounds, and one matched vertex by vertex.
std::vector<Graph> meshes(std::mt19937& random) {
  std::vector<Graph> out;
  for (const Graph& g : {brick(32, 30, 28, 1), brick(20, 20, 3, 1)}) {
    std::vector<Index> name(at(g.n));
    std::iota(name.begin(), name.end(), 0);
    std::shuffle(name.begin(), name.end(), random);
    Edges e;
    for (Index v = 0; v < g.n; ++v)
      for (const Index u : g.neighbours(v))
        if (u < v) e.emplace_back(name[at(u)], name[at(v)]);
    out.push_back(graph_of_edges(g.n, e));
  }
  return out;
}

void with_workers(int threads, const std::function<void(base::Recursion&)>& body) {
  base::ThreadPool pool(threads);
  base::Recursion::run(pool, body);
}

TEST(MatchPairs, AMaximalMatchingOfLightPairsForAnyThreads) {
  std::mt19937 random(3);
  constexpr Offset kMost = 8;
  for (const Graph& g : meshes(random)) {
    const PartGraph p = part_graph(g, random);
    std::vector<Index> first;
    for (const int threads : {1, 2, 4}) {
      std::vector<Index> mate;
      with_workers(threads, [&](base::Recursion& r) {
        Random seed(5);
        mate = match_pairs(p, kMost, seed, r);
      });
      if (first.empty()) first = mate;
      ASSERT_EQ(mate, first) << threads << " threads";
    }
    Index single = 0;
    for (Index v = 0; v < g.n; ++v) {
      const Index u = first[at(v)];
      ASSERT_EQ(first[at(u)], v);
      if (u != v) {
        const auto neighbours = g.neighbours(v);
        ASSERT_TRUE(std::binary_search(neighbours.begin(), neighbours.end(), u));
        ASSERT_LE(p.weight[at(u)] + p.weight[at(v)], kMost);
        continue;
      }
      ++single;
      for (const Index w : g.neighbours(v))
        ASSERT_TRUE(first[at(w)] != w || p.weight[at(w)] + p.weight[at(v)] > kMost) << v << " and " << w;
    }
    EXPECT_LT(10 * single, 2 * g.n);  // a mesh is matched but for a few
  }
}

/// The sums over all pairs of vertices are the truth.
TEST(Coarsen, KeepsWeightsAndEdgesForAnyThreads) {
  std::mt19937 random(11);
  for (const Graph& g : meshes(random)) {
    const PartGraph p = part_graph(g, random);
    Coarser first;
    for (const int threads : {1, 4}) {
      Coarser c;
      with_workers(threads, [&](base::Recursion& r) {
        Random seed(2);
        c = coarsen(p, p.total, seed, r);
      });
      if (threads == 1) {
        first = c;
        continue;
      }
      EXPECT_EQ(c.map, first.map);
      EXPECT_EQ(c.graph.ptr, first.graph.ptr);
      EXPECT_EQ(c.graph.adj, first.graph.adj);
      EXPECT_EQ(c.graph.edge, first.graph.edge);
    }
    std::map<std::pair<Index, Index>, Offset> edges;
    std::vector<Index> weight(at(first.graph.n()), 0);
    for (Index v = 0; v < g.n; ++v) {
      weight[at(first.map[at(v)])] += p.weight[at(v)];
      for (Offset e = g.ptr[at(v)]; e < g.ptr[at(v) + 1]; ++e)
        if (const Index a = first.map[at(v)], b = first.map[at(g.adj[at(e)])]; a != b) edges[{a, b}] += p.edge[at(e)];
    }
    EXPECT_EQ(weight, first.graph.weight);
    ASSERT_EQ(edges.size(), first.graph.adj.size());
    for (Index v = 0; v < first.graph.n(); ++v)
      for (Offset e = first.graph.ptr[at(v)]; e < first.graph.ptr[at(v) + 1]; ++e)
        ASSERT_EQ((edges[{v, first.graph.adj[at(e)]}]), first.graph.edge[at(e)]);
  }
}

/// Depth-first search is the truth.
TEST(Components, AgreeWithASearch) {
  std::mt19937 random(23);
  for (int round = 0; round < 60; ++round) {
    const Index n = round < 50 ? 1 + static_cast<Index>(random() % 200) : 40000;
    const auto wanted = static_cast<Index>(random() % (2 * static_cast<unsigned>(n)));
    const Graph g = graph_of_edges(n, random_edges(n, wanted, random));
    std::vector<Index> truth(at(n), -1);
    Index count = 0;
    for (Index root = 0; root < n; ++root) {
      if (truth[at(root)] >= 0) continue;
      std::vector<Index> stack{root};
      truth[at(root)] = count;
      while (!stack.empty()) {
        const Index v = stack.back();
        stack.pop_back();
        for (const Index u : g.neighbours(v))
          if (truth[at(u)] < 0) {
            truth[at(u)] = count;
            stack.push_back(u);
          }
      }
      ++count;
    }
    with_workers(1 + round % 4, [&](base::Recursion& r) {
      std::vector<Index> component;
      EXPECT_EQ(components(part_graph(g, random), component, r), count) << "round " << round;
      EXPECT_EQ(component, truth) << "round " << round;
    });
  }
}

TEST(Induced, HoldsTheEdgesBetweenItsVertices) {
  std::mt19937 random(29);
  const Index n = 30000;
  const Graph g = graph_of_edges(n, random_edges(n, 3 * n, random));
  std::vector<char> pick(at(n));
  for (char& c : pick) c = static_cast<char>(random() % 3);
  std::vector<Index> weight(at(n));
  for (Index v = 0; v < n; ++v) weight[at(v)] = v % 9;
  with_workers(3, [&](base::Recursion& r) {
    std::vector<Index> place(at(n), -1);
    const std::vector<Index> members = members_of(pick, 1, place, r);
    const PartGraph part = induced(g.ptr, g.adj, weight, members, place, r);
    std::vector<Index> truth;
    for (Index v = 0; v < n; ++v)
      if (pick[at(v)] == 1) truth.push_back(v);
    ASSERT_EQ(members, truth);
    Offset total = 0;
    for (std::size_t k = 0; k < members.size(); ++k) {
      total += weight[at(members[k])];
      EXPECT_EQ(part.weight[k], weight[at(members[k])]);
      std::vector<Index> kept;
      for (const Index u : g.neighbours(members[k]))
        if (pick[at(u)] == 1) kept.push_back(u);
      ASSERT_EQ(part.ptr[k + 1] - part.ptr[k], static_cast<Offset>(kept.size()));
      for (std::size_t e = 0; e < kept.size(); ++e) ASSERT_EQ(members[at(part.adj[at(part.ptr[k]) + e])], kept[e]);
    }
    EXPECT_EQ(part.total, total);
    EXPECT_EQ(std::count(part.edge.begin(), part.edge.end(), 1), static_cast<std::ptrdiff_t>(part.edge.size()));
  });
}

}  // namespace
}  // namespace espalier::analysis

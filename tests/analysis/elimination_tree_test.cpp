// Elimination trees, postorders and column counts. Truth: elimination of sets, entry by entry.
#include "analysis/elimination_tree.hpp"

#include <gtest/gtest.h>

#include <numeric>
#include <random>
#include <set>
#include <vector>

#include "analysis/graphs.hpp"

namespace espalier::analysis {
namespace {

namespace elimination_tree_test {

using namespace testing;

// Rows below the diagonal of each column of L, by position.
std::vector<std::set<Index>> columns_of_factor(const Graph& g, const std::vector<Index>& order) {
  std::vector<Index> position(order.size());
  for (std::size_t k = 0; k < order.size(); ++k) position[static_cast<std::size_t>(order[k])] = static_cast<Index>(k);
  std::vector<std::set<Index>> columns(order.size());
  for (Index k = 0; k < g.n; ++k) {
    std::set<Index>& column = columns[static_cast<std::size_t>(k)];
    for (const Index u : g.neighbours(order[static_cast<std::size_t>(k)]))
      if (const Index i = position[static_cast<std::size_t>(u)]; i > k) column.insert(i);
    if (column.empty()) continue;
    const Index parent = *column.begin();
    for (const Index i : column)
      if (i != parent) columns[static_cast<std::size_t>(parent)].insert(i);
  }
  return columns;
}

// Components of up to `largest` vertices, each a tree and a few more edges, in the order of the vertices or mixed.
Graph forest(Index n, Index largest, std::mt19937_64& random) {
  Edges edges;
  for (Index begin = 0; begin < n;) {
    const Index end =
        std::min<Index>(n, begin + 1 + static_cast<Index>(random() % static_cast<std::uint64_t>(largest)));
    const auto any_below = [&](Index v) {
      return begin + static_cast<Index>(random() % static_cast<std::uint64_t>(v - begin));
    };
    for (Index v = begin + 1; v < end; ++v) {
      edges.emplace_back(v, any_below(v));
      if (random() % 4 == 0) edges.emplace_back(v, any_below(v));
    }
    begin = end;
  }
  return graph_of_edges(n, edges);
}

TEST(EliminationTree, OfForestsIsThatOfEliminationBySets) {
  base::ThreadPool pool(3);
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    SCOPED_TRACE(::testing::Message() << "seed " << seed);
    std::mt19937_64 random(seed);
    const Index n = 1 + static_cast<Index>(random() % 500);
    const Graph g = forest(n, seed % 3 == 0 ? n : 1 + n / 8, random);
    std::vector<Index> order(static_cast<std::size_t>(n));
    std::iota(order.begin(), order.end(), 0);
    if (seed % 2 == 0) std::shuffle(order.begin(), order.end(), random);
    const std::vector<std::set<Index>> columns = columns_of_factor(g, order);
    const std::vector<Index> parent = elimination_tree(g, order, pool);
    for (std::size_t k = 0; k < columns.size(); ++k)
      ASSERT_EQ(parent[k], columns[k].empty() ? -1 : *columns[k].begin());

    // In postorder, each vertex with a weight of its own.
    const std::vector<Index> post = postorder(parent);
    std::vector<Index> sorted(post.size()), parent_now(post.size()), position(post.size()), weight(post.size());
    for (std::size_t k = 0; k < post.size(); ++k) {
      position[static_cast<std::size_t>(post[k])] = static_cast<Index>(k);
      sorted[k] = order[static_cast<std::size_t>(post[k])];
      weight[k] = 1 + static_cast<Index>(random() % 5);
    }
    for (std::size_t k = 0; k < post.size(); ++k) {
      const Index up = parent[static_cast<std::size_t>(post[k])];
      parent_now[k] = up < 0 ? -1 : position[static_cast<std::size_t>(up)];
      ASSERT_TRUE(up < 0 || parent_now[k] > static_cast<Index>(k));
    }
    const std::vector<Index> count = column_weights(permute(g, sorted, pool), parent_now, weight, pool);
    const std::vector<std::set<Index>> columns_now = columns_of_factor(g, sorted);
    for (std::size_t k = 0; k < post.size(); ++k) {
      Index expected = weight[k];
      for (const Index i : columns_now[k]) expected += weight[static_cast<std::size_t>(i)];
      ASSERT_EQ(count[k], expected) << "vertex " << k;
    }
  }
}

}  // namespace elimination_tree_test

}  // namespace
}  // namespace espalier::analysis

#include "analysis/ordering.hpp"

#include <gtest/gtest.h>

#include <numeric>
#include <random>

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

}  // namespace
}  // namespace espalier::analysis

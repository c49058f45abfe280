#include "analysis/ordering/graph.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>
#include <set>

#include "graphs.hpp"

namespace espalier::analysis {
namespace {

using namespace testing;

/// A random square matrix; rows in any order, duplicates allowed.
SparseMatrix random_matrix(Index n, Index per_column, Storage storage, std::mt19937& random) {
  SparseMatrix m{n, n, {0}, {}, {}, storage};
  for (Index j = 0; j < n; ++j) {
    for (Index k = 0; k < per_column; ++k) {
      const auto i = static_cast<Index>(random() % static_cast<unsigned>(n));
      if (storage == Storage::symmetric_lower && i < j) continue;
      if (storage == Storage::symmetric_upper && i > j) continue;
      m.row_ind.push_back(i);
    }
    m.col_ptr.push_back(static_cast<Offset>(m.row_ind.size()));
  }
  return m;
}

/// The same by sets: the truth.
Graph graph_by_sets(const SparseMatrix& m, const std::vector<Index>& column_of_row) {
  Edges e;
  for (Index j = 0; j < m.cols; ++j)
    for (Offset k = m.col_ptr[static_cast<std::size_t>(j)]; k < m.col_ptr[static_cast<std::size_t>(j) + 1]; ++k)
      e.emplace_back(column_of_row[static_cast<std::size_t>(m.row_ind[static_cast<std::size_t>(k)])], j);
  return graph_of_edges(m.cols, e);
}

TEST(GraphOf, EqualsTheUnionOfBothTriangles) {
  for (unsigned seed = 0; seed < 60; ++seed) {
    std::mt19937 random(seed);
    const Index n = 1 + static_cast<Index>(random() % 200);
    const Storage storage = static_cast<Storage>(seed % 4);
    const SparseMatrix m = random_matrix(n, static_cast<Index>(random() % 6), storage, random);
    std::vector<Index> identity(static_cast<std::size_t>(n));
    std::iota(identity.begin(), identity.end(), 0);
    base::ThreadPool pool(1 + static_cast<int>(seed % 3));
    const Graph g = graph_of(m, pool), truth = graph_by_sets(m, identity);
    ASSERT_EQ(g.ptr, truth.ptr) << "seed " << seed;
    ASSERT_EQ(g.adj, truth.adj) << "seed " << seed;
    if (storage != Storage::general) continue;
    std::vector<Index> column_of_row = identity;  // a row permutation
    std::shuffle(column_of_row.begin(), column_of_row.end(), random);
    std::vector<Index> row_of_col(identity);
    for (std::size_t i = 0; i < row_of_col.size(); ++i)
      row_of_col[static_cast<std::size_t>(column_of_row[i])] = static_cast<Index>(i);
    const Graph p = graph_of(m, pool, row_of_col), permuted = graph_by_sets(m, column_of_row);
    ASSERT_EQ(p.ptr, permuted.ptr) << "seed " << seed;
    ASSERT_EQ(p.adj, permuted.adj) << "seed " << seed;
  }
}

TEST(GraphOf, UnmatchedColumnsTakeTheRowsThatAreLeft) {
  // Column 0 holds rows 1 and 2, column 2 row 0; row 2 is matched to column 0, so column 1 takes row 0 and column 2
  // row 1.
  const SparseMatrix m{3, 3, {0, 2, 2, 3}, {1, 2, 0}, {}, Storage::general};
  base::ThreadPool pool(1);
  const std::vector<Index> row_of_col{2, -1, -1};
  const Graph g = graph_of(m, pool, row_of_col);
  EXPECT_EQ(g.ptr, (std::vector<Offset>{0, 1, 2, 4}));  // entries (1, 0) -> (2, 0), (0, 2) -> (1, 2)
}

TEST(Compress, FindsTheThreeUnknownsOfANode) {
  base::ThreadPool pool(2);
  const CompressedGraph c = compress(brick(5, 6, 7, 3), {}, pool);
  const Graph points = brick(5, 6, 7, 1);
  EXPECT_EQ(c.graph.ptr, points.ptr);
  EXPECT_EQ(c.graph.adj, points.adj);
  EXPECT_EQ(c.weight, std::vector<Index>(210, 3));
}

/// Vertices of one group have equal closed neighbourhoods, those of two groups different ones; edges are kept.
TEST(Compress, GroupsAreExactlyTheTwins) {
  base::ThreadPool pool(2);
  int merged = 0;
  for (unsigned seed = 0; seed < 80; ++seed) {
    std::mt19937 random(seed);
    const Index n = 2 + static_cast<Index>(random() % 40);
    Edges e = random_edges(n, n * (1 + static_cast<Index>(seed % 8)), random);
    const Graph random_graph = graph_of_edges(n, e);
    for (const Index u : random_graph.neighbours(0)) e.emplace_back(1, u);  // vertex 1 touches what 0 touches
    e.emplace_back(0, 1);
    const Graph g = graph_of_edges(n, e);
    const CompressedGraph c = compress(g, {}, pool);
    std::vector<Index> group(static_cast<std::size_t>(n));
    for (Index v = 0; v < c.graph.n; ++v)
      for (Index k = c.member_ptr[static_cast<std::size_t>(v)]; k < c.member_ptr[static_cast<std::size_t>(v) + 1]; ++k)
        group[static_cast<std::size_t>(c.members[static_cast<std::size_t>(k)])] = v;
    const auto closed = [&](Index v) {
      std::set<Index> s(g.neighbours(v).begin(), g.neighbours(v).end());
      s.insert(v);
      return s;
    };
    for (Index u = 0; u < n; ++u)
      for (Index v = 0; v < u; ++v) {
        const bool together = group[static_cast<std::size_t>(u)] == group[static_cast<std::size_t>(v)];
        ASSERT_EQ(together, closed(u) == closed(v)) << "seed " << seed;
        merged += together ? 1 : 0;
        if (together) continue;
        const auto list = c.graph.neighbours(group[static_cast<std::size_t>(v)]);
        ASSERT_EQ(std::binary_search(list.begin(), list.end(), group[static_cast<std::size_t>(u)]),
                  closed(u).count(v) == 1);
      }
  }
  EXPECT_GT(merged, 20);
}

}  // namespace
}  // namespace espalier::analysis

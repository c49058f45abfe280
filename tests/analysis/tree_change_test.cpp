// Trees that follow a crack. Truth: trees that are ordered anew for the same graphs, and verify_tree().
#include "analysis/tree_change.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <utility>

#include "analysis/graphs.hpp"
#include "analysis/ordering.hpp"
#include "analysis/verify.hpp"

namespace espalier::analysis {
namespace {

using namespace testing;

double entries_of(const AssemblyTree& t) {
  double entries = 0;
  for (Index f = 0; f < t.fronts(); ++f) {
    const double k = t.pivots(f), m = k + t.rows_below(f);
    entries += k * m - k * (k - 1) / 2;
  }
  return entries;
}

SparseMatrix pattern_of(const Graph& g) {
  SparseMatrix a{g.n, g.n, {0}, {}, {}, Storage::symmetric_lower};
  for (Index c = 0; c < g.n; ++c) {
    a.row_ind.push_back(c);
    for (const Index r : g.neighbours(c))
      if (r > c) a.row_ind.push_back(r);
    a.col_ptr.push_back(static_cast<Offset>(a.row_ind.size()));
  }
  return a;
}

// A bar of points, 3 unknowns each, that a crack parts in the middle, where its first separator is: a line of points a
// step.
TEST(TreeChange, UnknownsThatHoldNothingApartAnyMoreGoDown) {
  constexpr Index kLength = 24, kSide = 8, kDofs = 3;
  base::ThreadPool pool(2);
  Graph g = brick(kLength, kSide, kSide, kDofs);
  AssemblyTree tree = build_tree(g, {}, pool);
  const auto crosses = [&](Index u, Index v, Index lines) {
    const Index p = u / kDofs, q = v / kDofs;
    const bool across = (p % kLength < kLength / 2) != (q % kLength < kLength / 2);
    return across && std::max(p, q) / kLength / kSide < lines;
  };
  double worst = 0;
  for (Index lines = 1; lines <= kSide; ++lines) {
    Edges left;
    std::vector<PatternChange::Edge> gone;
    for (Index u = 0; u < g.n; ++u)
      for (const Index v : g.neighbours(u))
        if (v < u) (crosses(u, v, lines) ? gone : left).emplace_back(u, v);
    g = graph_of_edges(g.n, left);
    const SparseMatrix a = pattern_of(g);
    const matrix::RowIndex rows = matrix::index_rows(a, pool);
    const MatrixView view = a;
    tree = change_tree(tree, {{}, std::move(gone), {}, view, rows}, pool).tree;
    ASSERT_EQ(verify_tree(g, tree), "") << lines << " lines";
    const double fresh = entries_of(build_tree(g, {}, pool));
    worst = std::max(worst, entries_of(tree) / fresh);
  }
  EXPECT_LE(worst, 1.07) << "1.15 where unknowns stay in a separator that does not separate any more";
}

}  // namespace
}  // namespace espalier::analysis

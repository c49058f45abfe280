// Truth: fresh analyses of the same matrices; the campaign espalier_follow does thousands of these.
#include <random>

#include "analysis/ordering.hpp"
#include "analysis/tree_change.hpp"
#include "analysis/verify.hpp"
#include "solver_common.hpp"
#include "verdict/changes.hpp"

namespace espalier::test {

namespace analyze_change_test {

TEST(AnalyzeChange, IsAsGoodAsAFreshAnalysis) {
  for (int sort = 0; sort < verdict::ChangingSystem::sorts(); ++sort) {
    int followed = 0;
    for (std::uint64_t seed = 1; seed <= 6; ++seed) {
      verdict::ChangingSystem system(sort, static_cast<Index>(30 + 40 * seed),
                                     100 * seed + static_cast<std::uint64_t>(sort));
      Options o = two_threads();
      o.kind = system.kind();
      Solver solver(o);
      Offset fill = solver.analyze(system.matrix()).nonzeros_factor;
      for (int k = 0; k < 8 && solver.state() != Solver::State::empty; ++k) {
        system.change();
        const verdict::ChangeVerdict v = verdict::follow(solver, system, fill);
        EXPECT_EQ(v.wrong, "") << "sort " << sort << ", seed " << seed << ", change " << k;
        followed += v.full ? 0 : 1;
      }
    }
    EXPECT_GT(followed, 0) << "sort " << sort;
  }
}

// Pairs of neighbours at two steps along a face, and back: nothing of the fronts elsewhere changes.
SparseMatrix with_springs(const SparseMatrix& a, Index count, std::uint64_t seed) {
  std::vector<reference::Triple> t;
  for (Index c = 0; c < a.cols; ++c)
    for (Offset q = a.col_ptr[static_cast<std::size_t>(c)]; q < a.col_ptr[static_cast<std::size_t>(c) + 1]; ++q)
      t.push_back({a.row_ind[static_cast<std::size_t>(q)], c, a.values[static_cast<std::size_t>(q)]});
  std::mt19937_64 random(seed);
  const Index first = a.cols - a.cols / 20;
  for (Index k = 0; k < count; ++k) {
    const auto u =
        static_cast<Index>(first + static_cast<Index>(random() % static_cast<std::uint64_t>(a.cols - first)));
    const Index v = u - 9;
    t.push_back({u, u, 1.0});
    t.push_back({v, v, 1.0});
    t.push_back({u, v, -1.0});
  }
  return reference::from_triples(a.cols, t, Storage::symmetric_lower);
}

SparseMatrix natural_elasticity(Index n) {
  matrix::GeneratorSpec spec = matrix::parse_generator(std::vector<std::string>{"elasticity", std::to_string(n)});
  spec.numbering = matrix::Numbering::natural;
  return matrix::generate(spec);
}

TEST(AnalyzeChange, FrontsThatTheChangeDoesNotTouchStay) {
  const SparseMatrix a = natural_elasticity(10), b = with_springs(a, 20, 1);
  Solver solver(two_threads());
  ASSERT_TRUE(solver.analyze(a).status.ok());
  const ChangeResult there = solver.analyze_change(b);
  ASSERT_FALSE(there.full) << there.why;
  EXPECT_GT(there.added_entries, 0);
  EXPECT_GT(there.kept_fronts, there.analysis.fronts / 2);
  ASSERT_TRUE(solver.factorize(b).status.ok());
  expect_small_error(solver, b);
  const ChangeResult back = solver.analyze_change(a);
  ASSERT_FALSE(back.full) << back.why;
  EXPECT_EQ(back.removed_entries, there.added_entries);
  ASSERT_TRUE(solver.factorize(a).status.ok());
  expect_small_error(solver, a);
}

TEST(AnalyzeChange, TheSamePatternKeepsEverything) {
  const SparseMatrix a = natural_elasticity(6);
  Solver solver(two_threads());
  const AnalysisResult first = solver.analyze(a);
  const ChangeResult same = solver.analyze_change(a);
  EXPECT_FALSE(same.full);
  EXPECT_EQ(same.kept_fronts, first.fronts);
  EXPECT_EQ(same.analysis.nonzeros_factor, first.nonzeros_factor);
  EXPECT_EQ(same.moved_unknowns, 0);
}

TEST(AnalyzeChange, TreesAreValidAndTheirRowsExact) {
  base::ThreadPool pool(2);
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    verdict::ChangingSystem system(static_cast<int>(seed % 2) * 4, static_cast<Index>(20 + seed), seed);
    const SparseMatrix before = system.matrix();
    system.change();
    const SparseMatrix after = system.matrix();
    const auto graph_before = analysis::graph_of(before, pool), graph_after = analysis::graph_of(after, pool);
    const analysis::AssemblyTree tree = analysis::build_tree(graph_before, {}, pool);
    const matrix::RowIndex rows = matrix::index_rows(after, pool);
    const MatrixView view_after = after, view_before = before;
    analysis::PatternChange change{{}, {}, {}, view_after, rows};
    for (Index u = 0; u < after.cols; ++u) {
      const auto x = graph_before.neighbours(u), y = graph_after.neighbours(u);
      for (const Index v : y)
        if (!std::binary_search(x.begin(), x.end(), v)) change.added.emplace_back(u, v);
      for (const Index v : x)
        if (!std::binary_search(y.begin(), y.end(), v)) change.removed.emplace_back(u, v);
    }
    const analysis::ChangedTree changed = analysis::change_tree(tree, change, pool);
    EXPECT_EQ(analysis::verify_tree(graph_after, changed.tree), "") << "seed " << seed;
    // Back again: whatever came has gone, so no front is larger than it must be for the pivots that it has.
    const matrix::RowIndex rows_before = matrix::index_rows(before, pool);
    const analysis::PatternChange undone{change.removed, change.added, {}, view_before, rows_before};
    const analysis::ChangedTree again = analysis::change_tree(changed.tree, undone, pool);
    EXPECT_EQ(analysis::verify_tree(graph_before, again.tree), "") << "seed " << seed;
  }
}

TEST(AnalyzeChange, OrdersAnewWhereItMustAndSaysWhy) {
  const SparseMatrix a = reference::random_system(50, 3, reference::Values::positive, 1);
  Solver solver(two_threads());
  EXPECT_THROW((void)solver.analyze_change(a), std::logic_error);
  ASSERT_TRUE(solver.analyze(a).status.ok());
  const auto anew = [&](const SparseMatrix& b, const std::string& why) {
    const ChangeResult r = solver.analyze_change(b);
    EXPECT_TRUE(r.analysis.status.ok()) << r.analysis.status.message;
    EXPECT_TRUE(r.full);
    EXPECT_NE(r.why.find(why), std::string::npos) << r.why;
    ASSERT_TRUE(solver.factorize(b).status.ok());
    expect_small_error(solver, b);
  };
  anew(reference::random_system(60, 3, reference::Values::positive, 2), "50 unknowns");
  anew(reference::random_system(60, 8, reference::Values::positive, 3), "%");
  anew(reference::stored_as(reference::random_system(60, 8, reference::Values::positive, 3), Storage::symmetric_upper),
       "storage");
  Options o = two_threads();
  for (Index v = 0; v < 50; ++v) o.permutation.push_back(49 - v);
  Solver ordered(o);
  ASSERT_TRUE(ordered.analyze(a).status.ok());
  EXPECT_NE(ordered.analyze_change(a).why.find("caller"), std::string::npos);
}

TEST(AnalyzeChange, BadMatricesLeaveNothing) {
  const SparseMatrix a = reference::random_system(20, 3, reference::Values::positive, 1);
  Solver solver(two_threads());
  ASSERT_TRUE(solver.analyze(a).status.ok());
  SparseMatrix bad = a;
  bad.values[3] = std::numeric_limits<double>::quiet_NaN();
  const ChangeResult r = solver.analyze_change(bad);
  EXPECT_EQ(r.analysis.status.code, StatusCode::invalid_input);
  EXPECT_EQ(solver.state(), Solver::State::empty);
}

TEST(AnalyzeChange, ClonesKeepTheirAnalysis) {
  const SparseMatrix a = natural_elasticity(5), b = with_springs(a, 5, 2);
  Solver solver(two_threads());
  ASSERT_TRUE(solver.analyze(a).status.ok());
  Solver clone = solver.clone();
  ASSERT_FALSE(solver.analyze_change(b).full);
  ASSERT_TRUE(clone.factorize(a).status.ok());
  expect_small_error(clone, a);
  ASSERT_TRUE(solver.factorize(b).status.ok());
  expect_small_error(solver, b);
}

}  // namespace analyze_change_test

}  // namespace espalier::test

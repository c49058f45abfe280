// Truth: fresh analyses of the same matrices; the campaign espalier_follow does thousands of these.
#include <random>

#include "analysis/ordering.hpp"
#include "analysis/tree_change.hpp"
#include "analysis/verify.hpp"
#include "matrix/generators/changing_body.hpp"
#include "plan/plan.hpp"
#include "solver/solver_common.hpp"
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

// The factor of before still solves its system, and takes new values.
void expect_usable(Solver& solver, const SparseMatrix& a) {
  ASSERT_EQ(solver.state(), Solver::State::factorized);
  expect_small_error(solver, a);
  ASSERT_TRUE(solver.factorize(a).status.ok());
  expect_small_error(solver, a);
}

TEST(AnalyzeChange, BadMatricesLeaveTheFactorAsItWas) {
  const SparseMatrix a = reference::random_system(20, 3, reference::Values::positive, 1);
  Solver solver(two_threads());
  ASSERT_TRUE(solver.analyze(a).status.ok());
  ASSERT_TRUE(solver.factorize(a).status.ok());
  const auto refused = [&](const SparseMatrix& bad, const std::string& what) {
    const ChangeResult r = solver.analyze_change(bad);
    EXPECT_EQ(r.analysis.status.code, StatusCode::invalid_input) << what;
    EXPECT_FALSE(r.analysis.status.message.empty()) << what;
    expect_usable(solver, a);
  };
  SparseMatrix bad = a;
  bad.values[3] = std::numeric_limits<double>::quiet_NaN();
  refused(bad, "not a number");
  for (const Index row : {Index{-1}, Index{20}, std::numeric_limits<Index>::max(), std::numeric_limits<Index>::min()}) {
    bad = a;
    bad.row_ind[5] = row;
    refused(bad, "row " + std::to_string(row));
  }
  bad = a;
  bad.col_ptr[4] = bad.col_ptr[5] + 1;
  refused(bad, "pointers that fall");
  bad = a;
  bad.values.pop_back();
  refused(bad, "a value is missing");
}

// Without the entries (u, v) and (v, u) of one unknown.
SparseMatrix without_unknown(const SparseMatrix& a, Index gone) {
  std::vector<reference::Triple> t;
  for (Index c = 0; c < a.cols; ++c)
    for (Offset q = a.col_ptr[static_cast<std::size_t>(c)]; q < a.col_ptr[static_cast<std::size_t>(c) + 1]; ++q)
      if (const Index r = a.row_ind[static_cast<std::size_t>(q)]; r != gone && c != gone)
        t.push_back({r, c, a.values[static_cast<std::size_t>(q)]});
  return reference::from_triples(a.cols, t, a.storage);
}

TEST(AnalyzeChange, EmptyRowsAreNamedAndTheFactorStays) {
  const std::pair<Kind, reference::Values> kinds[] = {{Kind::llt, reference::Values::positive},
                                                      {Kind::ldlt, reference::Values::indefinite},
                                                      {Kind::lu, reference::Values::general}};
  for (const auto& [kind, values] : kinds) {
    const SparseMatrix a = reference::random_system(80, 3, values, 5);
    Options o = two_threads();
    o.kind = kind;
    Solver solver(o);
    ASSERT_TRUE(solver.analyze(a).status.ok());
    ASSERT_TRUE(solver.factorize(a).status.ok());
    const ChangeResult r = solver.analyze_change(without_unknown(a, 17));
    EXPECT_EQ(r.analysis.status.code, StatusCode::singular);
    EXPECT_EQ(r.analysis.status.row, 17);
    EXPECT_NE(r.analysis.status.message.find("row 17"), std::string::npos) << r.analysis.status.message;
    expect_usable(solver, a);
  }
}

TEST(AnalyzeChange, DuplicatesAreSummed) {
  const SparseMatrix a = natural_elasticity(5), b = with_springs(a, 5, 2);
  SparseMatrix twice = b;
  twice.row_ind.clear();
  twice.values.clear();
  twice.col_ptr.assign(1, 0);
  for (Index c = 0; c < b.cols; ++c) {
    for (Offset q = b.col_ptr[static_cast<std::size_t>(c)]; q < b.col_ptr[static_cast<std::size_t>(c) + 1]; ++q)
      for (const double part : {0.25, 0.75}) {
        twice.row_ind.push_back(b.row_ind[static_cast<std::size_t>(q)]);
        twice.values.push_back(part * b.values[static_cast<std::size_t>(q)]);
      }
    twice.col_ptr.push_back(static_cast<Offset>(twice.row_ind.size()));
  }
  Solver solver(two_threads());
  ASSERT_TRUE(solver.analyze(a).status.ok());
  const ChangeResult r = solver.analyze_change(twice);
  ASSERT_TRUE(r.analysis.status.ok()) << r.analysis.status.message;
  EXPECT_FALSE(r.full) << r.why;
  ASSERT_TRUE(solver.factorize(twice).status.ok());
  expect_small_error(solver, b);
}

struct Sequence {
  double fill = 0;  // at worst, over that of a fresh analysis
  int anew = 0, reordered = 0;
  std::vector<Offset> entries;  // of the factor, after each change
  std::vector<double> x;        // with the last factor
};

Sequence follow_body(matrix::BodyChange sort, int threads, bool fresh) {
  matrix::ChangingBody body(sort, 10, 0.01, 3);
  Options o;
  o.threads = threads;
  Solver solver(o);
  Sequence s;
  SparseMatrix a = body.matrix();
  EXPECT_TRUE(solver.analyze(a).status.ok());
  for (int k = 1; k <= 100; ++k) {
    body.change();
    a = body.matrix();
    const ChangeResult r = solver.analyze_change(a);
    EXPECT_TRUE(r.analysis.status.ok()) << r.analysis.status.message;
    s.entries.push_back(r.analysis.nonzeros_factor);
    s.anew += r.full ? 1 : 0;
    s.reordered += r.reordered ? 1 : 0;
    if (!fresh || k % 20 != 0) continue;
    Solver other(o);
    s.fill = std::max(s.fill, static_cast<double>(r.analysis.nonzeros_factor) /
                                  static_cast<double>(other.analyze(a).nonzeros_factor));
  }
  EXPECT_TRUE(solver.factorize(a).status.ok());
  const std::vector<double> b = reference::random_vector(a.cols, 9);
  s.x.resize(b.size());
  EXPECT_LT(solver.solve(b, s.x).backward_error, 1e-14);
  return s;
}

// Truth: fresh analyses. What is taken, and when, does not depend on threads or on time.
TEST(AnalyzeChange, AHundredChangesStayNearAFreshOrder) {
  int reordered = 0;
  for (const auto sort : {matrix::BodyChange::contacts, matrix::BodyChange::elements, matrix::BodyChange::crack,
                          matrix::BodyChange::remesh}) {
    const Sequence two = follow_body(sort, 2, true);
    EXPECT_LE(two.fill, 1.05) << "sort " << static_cast<int>(sort);
    EXPECT_LT(two.anew, 10) << "sort " << static_cast<int>(sort);
    reordered += two.reordered;
    if (two.reordered == 0 || sort == matrix::BodyChange::elements) continue;
    const Sequence one = follow_body(sort, 1, false);
    EXPECT_EQ(one.entries, two.entries) << "sort " << static_cast<int>(sort);
    EXPECT_EQ(one.reordered, two.reordered) << "sort " << static_cast<int>(sort);
    EXPECT_EQ(one.x, two.x) << "sort " << static_cast<int>(sort);
  }
  EXPECT_GT(reordered, 0);
}

// An order that is being made is stopped by whatever ends it.
TEST(AnalyzeChange, OrdersBesideTheWorkEndWithTheirSolver) {
  matrix::ChangingBody body(matrix::BodyChange::remesh, 12, 0.03, 4);
  std::string log;
  Options o = two_threads();
  o.log = [&](const std::string& line) { log += line + "\n"; };
  const auto drift = [&](Solver& solver) {
    log.clear();
    for (int k = 0; k < 30 && log.find("made beside") == std::string::npos; ++k) {
      body.change();
      ASSERT_TRUE(solver.analyze_change(body.matrix()).analysis.status.ok());
    }
    ASSERT_NE(log.find("made beside"), std::string::npos);
  };
  Solver solver(o);
  ASSERT_TRUE(solver.analyze(body.matrix()).status.ok());
  drift(solver);
  const SparseMatrix other = natural_elasticity(4);
  ASSERT_TRUE(solver.analyze(other).status.ok());  // instead
  ASSERT_TRUE(solver.factorize(other).status.ok());
  expect_small_error(solver, other);
  ASSERT_TRUE(solver.analyze(body.matrix()).status.ok());
  drift(solver);
  const SparseMatrix a = body.matrix();
  Solver clone = solver.clone();
  solver = Solver(o);  // and the thread with it
  ASSERT_TRUE(clone.factorize(a).status.ok());
  expect_small_error(clone, a);
}

TEST(AnalyzeChange, AutoFindsAnotherKindWhereSymmetryEnds) {
  const SparseMatrix symmetric{2, 2, {0, 2, 4}, {0, 1, 0, 1}, {4, 1, 1, 3}, Storage::general};
  const SparseMatrix other{2, 2, {0, 2, 4}, {0, 1, 0, 1}, {4, 1, 2, 3}, Storage::general};
  for (const Kind kind : {Kind::automatic, Kind::llt}) {
    Options o = two_threads();
    o.kind = kind;
    Solver s(o);
    ASSERT_TRUE(s.analyze(symmetric).status.ok());
    const ChangeResult change = s.analyze_change(other);
    if (kind == Kind::llt) {
      EXPECT_EQ(change.analysis.status.code, StatusCode::invalid_input);
      continue;
    }
    ASSERT_TRUE(change.analysis.status.ok()) << change.analysis.status.message;
    EXPECT_TRUE(change.full);
    EXPECT_EQ(change.analysis.kind, Kind::lu);
    ASSERT_TRUE(s.factorize(other).status.ok());
    std::vector<double> x(2);
    ASSERT_TRUE(s.solve(std::vector<double>{6, 4}, x).status.ok());  // [4 2; 1 3] x = b
    EXPECT_NEAR(x[0], 1, 1e-15);
    EXPECT_NEAR(x[1], 1, 1e-15);
  }
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

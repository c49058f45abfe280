// Named cases of changes around a factor. Truth: dense systems, eigenvalues, a factor of the changed matrix.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>
#include <span>

#include "changes/dense_changes.hpp"

namespace espalier::test {

namespace changed_cases_test {

using namespace changed;

TEST(ChangedCases, ConstraintsOfKktSystemsComeAndGo) {
  const SparseMatrix a = reference::saddle_point(60, 10, 4);
  Solver solver = factorized(a, Kind::ldlt);
  ChangedSystem changed(solver);
  Dense dense(a);
  std::vector<double> g(at(a.cols), 0.0);
  for (Index v = 0; v < a.cols; ++v)
    if (dense.entry(v, v) > 0) g[at(v)] = v % 7 == 0 ? 1 : 0;
  ASSERT_TRUE(changed.add(g, 1).ok());
  EXPECT_EQ(changed.inertia().positive, 60);
  EXPECT_EQ(changed.inertia().negative, 11);
  for (Index v = 0; v < a.cols; ++v)
    if (dense.entry(v, v) == 0) {
      ASSERT_TRUE(changed.remove(std::vector<Index>{v}).ok());  // a multiplier
      break;
    }
  EXPECT_EQ(changed.inertia().positive, 60);
  EXPECT_EQ(changed.inertia().negative, 10);
  // The same constraint twice is one too many.
  ASSERT_TRUE(changed.add(g, 1).ok());
  EXPECT_EQ(changed.inertia().zero, 1);
  std::vector<double> b(at(changed.size()), 1.0), x(b.size());
  EXPECT_EQ(changed.solve(b, x).status.code, StatusCode::singular);
  ASSERT_TRUE(changed.remove(std::vector<Index>{changed.size() - 1}).ok());
  EXPECT_TRUE(changed.solve(b, x).status.ok());
}

TEST(ChangedCases, ASingularChangeIsSaid) {
  const SparseMatrix a = reference::from_triples(2, {{0, 0, 2.0}, {1, 1, 3.0}}, Storage::symmetric_lower);
  Solver solver = factorized(a, Kind::llt);
  ChangedSystem changed(solver);
  ASSERT_TRUE(changed.add_low_rank(std::vector<double>{1, 0}, 1, std::vector<double>{-2.0}).ok());  // row 0 is gone
  std::vector<double> b{1, 1}, x(2);
  EXPECT_EQ(changed.solve(b, x).status.code, StatusCode::singular);
  EXPECT_EQ(changed.inertia().zero, 1);
  EXPECT_EQ(changed.inertia().positive, 1);
}

// An equation that says nothing beside one that says something: the condensed rows are [x 0; 0 0].
TEST(ChangedCases, AnEmptyRowBesideOthersIsSingular) {
  const SparseMatrix a = reference::random_system(20, 3, reference::Values::positive, 1);
  Solver solver = factorized(a, Kind::llt);
  for (const bool first : {true, false}) {
    ChangedSystem changed(solver);
    const std::vector<double> nothing(20, 0.0), something = reference::random_vector(20, 4);
    ASSERT_TRUE(changed.add(first ? nothing : something, 1).ok());
    ASSERT_TRUE(changed.add(first ? something : nothing, 1).ok());
    std::vector<double> b(22, 1.0), x(22);
    EXPECT_EQ(changed.solve(b, x).status.code, StatusCode::singular) << first;
  }
}

TEST(ChangedCases, ChangesOfNothingAndSingularCores) {
  const SparseMatrix a = reference::random_system(20, 3, reference::Values::positive, 1);
  Solver solver = factorized(a, Kind::llt);
  ChangedSystem changed(solver);
  Dense dense(a);
  expect_solves(changed, dense, {}, true);
  ASSERT_TRUE(changed.add_low_rank(std::vector<double>(40, 0.0), 2).ok());
  expect_solves(changed, dense, {}, true);
  ASSERT_TRUE(changed.add_low_rank(reference::random_vector(40, 1), 2, std::vector<double>(4, 0.0)).ok());
  expect_solves(changed, dense, {}, true);
  changed.reset();
  EXPECT_EQ(changed.changes(), 0);
}

/// |M x - b| of the changed matrix without its removed rows, as expect_solves() forms it.
double error_beside(Dense& dense, const std::vector<Index>& removed, const std::vector<double>& b,
                    const std::vector<double>& x, bool transpose = false) {
  std::vector<double> b_left, x_left;
  for (Index v = 0; v < dense.n; ++v)
    if (std::find(removed.begin(), removed.end(), v) == removed.end()) {
      b_left.push_back(b[at(v)]);
      x_left.push_back(x[at(v)]);
    }
  return reference::backward_error(dense.without(removed), b_left, x_left, 1, transpose);
}

// Factors in single precision without refinement leave errors far above rounding: what is reported is held against the
// residual of the changed matrix itself, not against a bound.
TEST(ChangedCases, ErrorsAreReportedAsTheyAre) {
  const SparseMatrix a = reference::random_system(60, 4, reference::Values::positive, 5);
  Options o;
  o.device = "cpu";
  o.threads = 2;
  o.precision = Precision::fp32;
  o.refinement_steps = 0;
  o.required_backward_error = std::numeric_limits<double>::infinity();
  for (const Kind kind : {Kind::llt, Kind::lu}) {
    o.kind = kind;
    Solver solver(o);
    ASSERT_TRUE(solver.analyze(a).status.ok());
    ASSERT_TRUE(solver.factorize(a).status.ok());
    ChangedSystem changed(solver);
    changed.set_folding(false);
    Dense dense(a);
    const std::vector<double> u = reference::random_vector(60, 7), g = reference::random_vector(60, 8);
    const double weight = 300;  // the row sums are those of what was added
    ASSERT_TRUE(changed.add_low_rank(u, 1, std::vector<double>{weight}).ok());
    for (Index c = 0; c < 60; ++c)
      for (Index r = 0; r < 60; ++r) dense.entry(r, c) += weight * u[at(r)] * u[at(c)];
    ASSERT_TRUE(changed.add(g, 1).ok());
    dense.grow(1);
    for (Index v = 0; v < 60; ++v) dense.entry(v, 60) = dense.entry(60, v) = g[at(v)];
    const std::vector<Index> removed{11, 30};
    ASSERT_TRUE(changed.remove(removed).ok());
    for (const bool transpose : {false, true}) {
      const std::vector<double> b = reference::random_vector(61, 9);
      std::vector<double> x(b.size());
      const SolveResult r = changed.solve(b, x, 1, transpose ? Transpose::yes : Transpose::no);
      ASSERT_TRUE(r.status.ok()) << r.status.message;
      const double error = error_beside(dense, removed, b, x, transpose);
      EXPECT_GT(error, 1e-13) << "there is something to report";
      EXPECT_NEAR(r.backward_error, error, 1e-3 * error);
    }
  }
}

/// With a large diagonal, so that it stays regular without some rows and columns.
SparseMatrix unsymmetric(Index n, std::uint64_t seed) {
  SparseMatrix a =
      reference::stored_as(reference::random_system(n, 4, reference::Values::positive, seed), Storage::general);
  const std::vector<double> other = reference::random_vector(static_cast<Index>(a.nonzeros()), seed);
  for (Index c = 0; c < n; ++c)
    for (Offset q = a.col_ptr[at(c)]; q < a.col_ptr[at(c) + 1]; ++q)
      if (a.row_ind[at(q)] != c) a.values[at(q)] *= other[at(q)];
  return a;
}

// One by one, each with a solve, around one factor; beside a factor of the changed matrix.
TEST(ChangedCases, AHundredFlipsLoseNothing) {
  const std::vector<std::pair<SparseMatrix, Kind>> cases{
      {reference::random_system(400, 4, reference::Values::positive, 3), Kind::llt},
      {reference::random_system(400, 4, reference::Values::indefinite, 4), Kind::ldlt},
      {reference::saddle_point(300, 60, 5), Kind::ldlt},
      {unsymmetric(400, 6), Kind::lu}};
  for (const auto& [a, kind] : cases) {
    SCOPED_TRACE(testing::Message() << "kind " << static_cast<int>(kind));
    Solver solver = factorized(a, kind);
    ChangedSystem changed(solver);
    changed.set_folding(false);
    Dense dense(a);
    std::vector<Index> removed;
    std::mt19937_64 random(9);
    std::vector<double> b = reference::random_vector(a.cols, 1), x(b.size()), y(b.size());
    int solved = 0;
    for (int k = 0; k < 100; ++k) {
      const auto v = static_cast<Index>(random() % at(a.cols));
      ASSERT_TRUE(changed.flip(std::vector<Index>{v}).ok());
      if (changed.removed(v))
        removed.push_back(v);
      else
        removed.erase(std::find(removed.begin(), removed.end(), v));
      const ChangedSolveResult r = changed.solve(b, x);
      if (r.status.code == StatusCode::singular) continue;  // constraints of which too few unknowns are left
      ASSERT_TRUE(r.status.ok()) << r.status.message;
      EXPECT_EQ(r.cost.factorizations, 0);
      ++solved;
    }
    EXPECT_GT(solved, 20);  // a constraint may lose all its unknowns: then none until one is back
    const double error = error_beside(dense, removed, b, x);
    const Status s = changed.fold();
    if (s.code == StatusCode::singular) continue;
    ASSERT_TRUE(s.ok()) << s.message;
    ASSERT_TRUE(changed.solve(b, y).status.ok());
    EXPECT_EQ(changed.cost().factorizations, 1);
    EXPECT_LE(error, 10 * error_beside(dense, removed, b, y) + kEps);
  }
}

// What a batch costs, and when it is cheaper to factorize: counted, so that it does not depend on the clock.
TEST(ChangedCases, FactorizesWhereThatIsCheaper) {
  const SparseMatrix a = reference::random_system(1200, 12, reference::Values::positive, 3);
  Solver solver = factorized(a, Kind::llt);
  ChangedSystem changed(solver);
  std::vector<double> b = reference::random_vector(a.cols, 1), x(b.size());
  std::vector<Index> few{1, 2, 3}, many;
  for (Index v = 10; v < 400; ++v) many.push_back(v);
  ASSERT_TRUE(changed.remove(few).ok());
  const ChangedSolveResult first = changed.solve(b, x);
  ASSERT_TRUE(first.status.ok()) << first.status.message;
  EXPECT_EQ(first.cost.factorizations, 0);
  EXPECT_EQ(first.cost.columns, 3);
  EXPECT_GT(first.cost.factorization, first.cost.changes);
  ASSERT_TRUE(changed.restore(few).ok());
  ASSERT_TRUE(changed.remove(few).ok());
  EXPECT_EQ(changed.solve(b, x).cost.columns, 3) << "columns of what came back are there";
  changed.set_folding(false);
  ASSERT_TRUE(changed.remove(many).ok());
  EXPECT_EQ(changed.changes(), 393);
  const ChangedSolveResult by_columns = changed.solve(b, x);
  ASSERT_TRUE(by_columns.status.ok()) << by_columns.status.message;
  EXPECT_EQ(by_columns.cost.columns, 393);
  EXPECT_GT(by_columns.cost.changes, by_columns.cost.factorization);
  std::vector<double> y(x.size());
  changed.reset();
  changed.set_folding(true);
  ASSERT_TRUE(changed.remove(few).ok());
  ASSERT_TRUE(changed.remove(many).ok());
  const ChangedSolveResult folded = changed.solve(b, y);
  ASSERT_TRUE(folded.status.ok()) << folded.status.message;
  EXPECT_EQ(folded.cost.factorizations, 1);
  EXPECT_EQ(folded.cost.columns, 0);
  EXPECT_EQ(changed.changes(), 0);
  for (std::size_t k = 0; k < x.size(); ++k) EXPECT_NEAR(x[k], y[k], 1e-10 * (1 + std::abs(x[k])));
  EXPECT_EQ(solver.values(), a.values) << "the solver's own factor stays";
}

// New columns one at a time: a factorization would not spare those of changes to come. Solves with many columns it
// would.
TEST(ChangedCases, ColumnsThatWereMadeAreNoReasonToFactorize) {
  const SparseMatrix a = reference::random_system(1200, 12, reference::Values::positive, 3);
  Solver solver = factorized(a, Kind::llt);
  ChangedSystem changed(solver);
  const std::vector<double> b = reference::random_vector(a.cols, 1);
  std::vector<double> x(b.size());
  double most = 0;
  Index flips = 0;
  for (Index v = 0; v < 40; ++v, ++flips) {
    ASSERT_TRUE(changed.flip(std::vector<Index>{v}).ok());
    const ChangedSolveResult s = changed.solve(b, x);
    ASSERT_TRUE(s.status.ok()) << s.status.message;
    ASSERT_EQ(s.cost.factorizations, 0) << "after " << v;
    most = s.cost.changes / s.cost.factorization;
  }
  EXPECT_GT(most, 1) << "or the test shows nothing";
  for (; changed.cost().factorizations == 0 && flips < 20000; ++flips) {  // one goes and comes: no new columns
    ASSERT_TRUE(changed.flip(std::vector<Index>{0}).ok());
    ASSERT_TRUE(changed.solve(b, x).status.ok());
  }
  EXPECT_EQ(changed.cost().factorizations, 1) << "solves with 40 columns add up";
}

TEST(ChangedCases, SingularChangesLeaveEverythingUsable) {
  const SparseMatrix a = reference::random_system(30, 3, reference::Values::positive, 1);
  Solver solver = factorized(a, Kind::llt);
  for (const bool folds : {false, true}) {
    ChangedSystem changed(solver);
    Dense dense(a);
    const std::vector<double> nothing(30, 0.0);
    ASSERT_TRUE(changed.remove(std::vector<Index>{4}).ok());
    ASSERT_TRUE(changed.add(nothing, 1).ok());  // an equation that says nothing
    dense.grow(1);
    std::vector<double> b(31, 1.0), x(31);
    const Status s = folds ? changed.fold() : changed.prepare();
    EXPECT_EQ(s.code, StatusCode::singular) << s.message;
    EXPECT_EQ(changed.solve(b, x).status.code, StatusCode::singular);
    ASSERT_TRUE(changed.remove(std::vector<Index>{30}).ok());
    expect_solves(changed, dense, {4, 30}, true);
  }
}

// Threads add in the same order.
TEST(ChangedCases, BitsDoNotDependOnThreads) {
  const SparseMatrix a = reference::random_system(900, 5, reference::Values::indefinite, 7);
  std::vector<double> first;
  for (const int threads : {1, 2, 3}) {
    Options o;
    o.threads = threads;
    o.device = "cpu";
    Solver solver(o);
    ASSERT_TRUE(solver.analyze(a).status.ok());
    ASSERT_TRUE(solver.factorize(a).status.ok());
    ChangedSystem changed(solver);
    std::vector<Index> list;
    for (Index v = 0; v < 40; ++v) list.push_back(13 * v);
    ASSERT_TRUE(changed.flip(list).ok());
    const std::vector<double> b = reference::random_vector(3 * a.cols, 1);
    std::vector<double> x(b.size());
    ASSERT_TRUE(changed.solve(b, x, 3).status.ok());
    if (first.empty()) first = x;
    EXPECT_EQ(first, x) << threads;
  }
}

TEST(ChangedCases, MisuseAndBadNumbersAreErrors) {
  const SparseMatrix a = reference::random_system(10, 3, reference::Values::positive, 1);
  Solver empty;
  EXPECT_THROW(ChangedSystem{empty}, std::logic_error);
  Solver solver = factorized(a, Kind::llt);
  ChangedSystem changed(solver);
  std::vector<double> u(10, 1.0), x(10);
  EXPECT_THROW((void)changed.add(u, 2), std::invalid_argument);
  EXPECT_THROW((void)changed.add(u, 0), std::invalid_argument);
  EXPECT_THROW((void)changed.add_low_rank(u, 1, u), std::invalid_argument);
  EXPECT_THROW((void)changed.solve(u, std::span(x).first(9)), std::invalid_argument);
  EXPECT_EQ(changed.remove(std::vector<Index>{3, 3}).code, StatusCode::invalid_input);
  EXPECT_EQ(changed.remove(std::vector<Index>{10}).row, 10);
  EXPECT_EQ(changed.restore(std::vector<Index>{2}).code, StatusCode::invalid_input);
  u[4] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(changed.add(u, 1).code, StatusCode::invalid_input);
  EXPECT_EQ(changed.add_low_rank(u, 1).code, StatusCode::invalid_input);
  EXPECT_EQ(changed.size(), 10);
  EXPECT_EQ(changed.solve(u, x).status.row, 4);
  EXPECT_EQ(changed.flip(std::vector<Index>{-1}).row, -1);
  EXPECT_EQ(changed.flip(std::vector<Index>{2, 2}).row, 2);
  EXPECT_THROW((void)changed.removed(10), std::out_of_range);
  Entries one, other;
  one.add_column(std::vector<double>(10, 1.0), 1);
  other.add_column(u, 1);
  EXPECT_EQ(changed.add(other.columns()).code, StatusCode::invalid_input);
  EXPECT_EQ(changed.add_low_rank(other.columns()).code, StatusCode::invalid_input);
  EXPECT_EQ(changed.replace(std::vector<Index>{3}, other.columns()).row, 4);
  EXPECT_EQ(changed.replace(std::vector<Index>{10}, one.columns()).row, 10);
  EXPECT_THROW((void)changed.replace(std::vector<Index>{3, 4}, one.columns()), std::invalid_argument);
  EXPECT_THROW((void)changed.add(SparseColumns{}), std::invalid_argument);
  one.rows.back() = 10;
  EXPECT_EQ(changed.add(one.columns()).row, 10);
  one.rows.back() = 0;
  one.ptr.back() -= 1;
  EXPECT_EQ(changed.add(one.columns()).code, StatusCode::invalid_input);
  EXPECT_EQ(changed.changes(), 0);
  ASSERT_TRUE(solver.factorize(a).status.ok());
  EXPECT_THROW((void)changed.solve(x, x), std::logic_error);
  changed.reset();
  EXPECT_TRUE(changed.solve(x, x).status.ok());
}

// Where singular matrices are no errors (singular = report), a changed one still is, whoever finds it.
TEST(ChangedCases, ASingularChangeIsSaidWhereSingularMatricesAreReported) {
  const SparseMatrix swap = reference::from_triples(2, {{1, 0, 1.0}, {0, 1, 1.0}}, Storage::general);
  for (const bool folds : {false, true}) {
    Options o;
    o.device = "cpu";
    o.threads = 1;
    o.singular = SingularMatrix::report;
    o.required_backward_error = std::numeric_limits<double>::infinity();
    Solver solver(o);
    ASSERT_TRUE(solver.analyze(swap).status.ok());
    ASSERT_TRUE(solver.factorize(swap).status.ok());
    ChangedSystem changed(solver);
    changed.set_folding(folds);
    ASSERT_TRUE(changed.remove(std::vector<Index>{0}).ok());  // [0] is left
    std::vector<double> b{1, 1}, x(2);
    EXPECT_EQ(changed.solve(b, x).status.code, StatusCode::singular) << folds;
    EXPECT_EQ(changed.fold().code, StatusCode::singular) << folds;
    ASSERT_TRUE(changed.restore(std::vector<Index>{0}).ok());
    ASSERT_TRUE(changed.solve(b, x).status.ok());
    EXPECT_EQ(x, b);
  }
}

// The error after a hundred flips is that of a fresh factor, with the transpose as well.
TEST(ChangedCases, AHundredFlipsLoseNothingWithTheTranspose) {
  const SparseMatrix a = unsymmetric(400, 6);
  Solver solver = factorized(a, Kind::lu);
  ChangedSystem changed(solver), by_rows(solver, true);
  changed.set_folding(false);
  by_rows.set_folding(false);
  Dense dense(a);
  std::vector<Index> removed;
  std::mt19937_64 random(9);
  const std::vector<double> b = reference::random_vector(a.cols, 1);
  std::vector<double> x(b.size()), y(b.size());
  double worst = 0;
  for (int k = 0; k < 100; ++k) {
    const auto v = static_cast<Index>(random() % at(a.cols));
    ASSERT_TRUE(changed.flip(std::vector<Index>{v}).ok());
    ASSERT_TRUE(by_rows.flip(std::vector<Index>{v}).ok());
    if (changed.removed(v))
      removed.push_back(v);
    else
      removed.erase(std::find(removed.begin(), removed.end(), v));
    const ChangedSolveResult r = changed.solve(b, x, 1, Transpose::yes);
    ASSERT_TRUE(r.status.ok()) << r.status.message;
    worst = std::max(worst, error_beside(dense, removed, b, x, true));
    ASSERT_TRUE(by_rows.solve(b, y).status.ok());  // it holds A^T
    EXPECT_EQ(x, y);
  }
  ASSERT_TRUE(changed.fold().ok());
  ASSERT_TRUE(changed.solve(b, y, 1, Transpose::yes).status.ok());
  EXPECT_LE(worst, 10 * error_beside(dense, removed, b, y, true) + kEps);
}

}  // namespace changed_cases_test

}  // namespace espalier::test

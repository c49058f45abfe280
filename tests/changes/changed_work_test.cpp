// Work that changes around a factor take, and what they do where digits cancel. Truth: dense matrices changed as said,
// a Schur complement in long double, solves that are cut short.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <stdexcept>
#include <vector>

#include "changes/dense_changes.hpp"

namespace espalier::test {

namespace changed_work_test {

using namespace changed;

/// A symmetric positive definite matrix whose condition has so many decades, and g^T A^-1 g in long double.
struct Narrow {
  SparseMatrix a;
  std::vector<double> g;
  long double complement;
};
Narrow narrow_system(Index n, double decades, unsigned seed) {
  using Long = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;
  const std::vector<double> entries = reference::random_vector(n * n, seed);
  const Eigen::MatrixXd q =
      Eigen::HouseholderQR<Eigen::MatrixXd>(Eigen::Map<const Eigen::MatrixXd>(entries.data(), n, n)).householderQ();
  const Eigen::VectorXd values =
      Eigen::VectorXd::LinSpaced(n, 0, -decades).unaryExpr([](double e) { return std::pow(10, e); });
  const Eigen::MatrixXd full = q * values.asDiagonal() * q.transpose();
  std::vector<reference::Triple> lower;
  for (Index c = 0; c < n; ++c)
    for (Index r = c; r < n; ++r) lower.push_back({r, c, full(r, c)});
  Narrow s{reference::from_triples(n, lower, Storage::symmetric_lower), reference::random_vector(n, seed + 1), 0};
  const Long g = Eigen::Map<const Eigen::VectorXd>(s.g.data(), n).cast<long double>();
  const Eigen::MatrixXd stored = full.selfadjointView<Eigen::Lower>();
  s.complement = g.col(0).dot(Long(Long(stored.cast<long double>()).llt().solve(g)).col(0));
  return s;
}

// A condensed row that cancels to some digits: its sign is that of the difference, with factors in either precision,
// whose columns alone would not tell.
TEST(ChangedWork, SignsOfRowsThatCancelAreRight) {
  for (const bool single : {false, true})
    for (unsigned seed = 1; seed <= 12; ++seed)
      for (const int sign : {1, -1}) {
        const Narrow s = narrow_system(16, single ? 3 : 6, 2 * seed);
        Options o = rough();
        o.kind = Kind::llt;
        o.precision = single ? Precision::fp32 : Precision::fp64;
        Solver solver(o);
        ASSERT_TRUE(solver.analyze(s.a).status.ok());
        ASSERT_TRUE(solver.factorize(s.a).status.ok());
        ChangedSystem changed(solver);
        const double difference = sign * (single ? 2e-6 : 3e-12);
        const std::vector<double> corner{static_cast<double>(s.complement * (1 + difference))};
        ASSERT_TRUE(changed.add(s.g, 1, {}, corner).ok());
        const Inertia inertia = changed.inertia();
        EXPECT_EQ(inertia.positive, sign > 0 ? 17 : 16) << seed;
        EXPECT_EQ(inertia.negative, sign > 0 ? 0 : 1) << seed;
      }
}

// Numbers beyond what can be said: singular, and gone with what has them.
TEST(ChangedWork, ProductsThatOverflowAreSingular) {
  const SparseMatrix a = reference::random_system(30, 3, reference::Values::positive, 1);
  Solver solver = factorized(a, Kind::llt);
  ChangedSystem changed(solver);
  changed.set_folding(false);
  Dense dense(a);
  ASSERT_TRUE(changed.add(std::vector<double>(30, 1e200), 1).ok());
  dense.grow(1);
  std::vector<double> b(31, 1.0), x(31);
  EXPECT_EQ(changed.solve(b, x).status.code, StatusCode::singular);
  ASSERT_TRUE(changed.remove(std::vector<Index>{30}).ok());
  expect_solves(changed, dense, {30}, true);
}

// Couplings of exactly 1 between added unknowns count like all others.
TEST(ChangedWork, OnesBetweenAddedUnknownsCount) {
  const SparseMatrix a = reference::random_system(30, 3, reference::Values::general, 1);
  Solver solver = factorized(a, Kind::lu);
  ChangedSystem changed(solver);
  Dense dense(a);
  const std::vector<double> u = reference::random_vector(60, 5), corner{2, 1, 1, 3};
  ASSERT_TRUE(changed.add(u, 2, u, corner).ok());
  dense.grow(2);
  for (Index k = 0; k < 2; ++k) {
    for (Index v = 0; v < 30; ++v) dense.entry(v, 30 + k) = dense.entry(30 + k, v) = u[at(30 * k + v)];
    for (Index j = 0; j < 2; ++j) dense.entry(30 + j, 30 + k) = corner[at(2 * k + j)];
  }
  expect_solves(changed, dense, {}, false);
}

// Columns of what comes back are kept, of so many as went last; what is dropped is made again.
TEST(ChangedWork, ManyThatCameBackAreDropped) {
  const SparseMatrix a = reference::random_system(300, 4, reference::Values::indefinite, 3);
  Solver solver = factorized(a, Kind::ldlt);
  ChangedSystem changed(solver);
  changed.set_folding(false);
  Dense dense(a);
  std::vector<Index> gone, back, left;
  for (Index v = 0; v < 100; ++v) gone.push_back(2 * v);
  ASSERT_TRUE(changed.remove(gone).ok());
  expect_solves(changed, dense, gone, true);
  back.assign(gone.begin(), gone.begin() + 90);
  left.assign(gone.begin() + 90, gone.end());
  ASSERT_TRUE(changed.restore(back).ok());
  expect_solves(changed, dense, left, true);
  EXPECT_EQ(changed.cost().columns, 100);
  left.push_back(back.back());
  ASSERT_TRUE(changed.remove(std::vector<Index>{back.back()}).ok());
  expect_solves(changed, dense, left, true);
  EXPECT_EQ(changed.cost().columns, 100) << "the last one is there";
  left.push_back(back.front());
  ASSERT_TRUE(changed.remove(std::vector<Index>{back.front()}).ok());
  expect_solves(changed, dense, left, true);
  EXPECT_EQ(changed.cost().columns, 101) << "the first one was dropped";
}

// Refinement goes on while it halves an error, column by column: as many steps as solves that are cut short show.
TEST(ChangedWork, RefinesWhileThatHalvesTheError) {
  const SparseMatrix a = reference::random_system(60, 4, reference::Values::positive, 5);
  for (const bool general : {false, true}) {
    std::vector<double> errors;
    const auto solve = [&](int steps) {
      Options o = rough();
      o.kind = general ? Kind::lu : Kind::llt;
      o.refinement_steps = steps;
      o.refinement_target = 0;
      Solver solver(o);
      EXPECT_TRUE(solver.analyze(a).status.ok());
      EXPECT_TRUE(solver.factorize(a).status.ok());
      ChangedSystem changed(solver);
      changed.set_folding(false);
      EXPECT_TRUE(changed.add_low_rank(reference::random_vector(60, 7), 1, std::vector<double>{3}).ok());
      EXPECT_TRUE(changed.add(reference::random_vector(60, 8), 1).ok());
      EXPECT_TRUE(changed.remove(std::vector<Index>{4}).ok());
      std::vector<double> b = reference::random_vector(61, 9), x(b.size());
      return changed.solve(b, x, 1, general ? Transpose::yes : Transpose::no);
    };
    const int kMost = 12;
    for (int steps = 0; steps <= kMost; ++steps) errors.push_back(solve(steps).backward_error);
    int expected = 1;
    while (expected < kMost && errors[at(expected)] <= errors[at(expected) - 1] / 2 && errors[at(expected)] > 0)
      ++expected;
    if (errors[at(expected)] == errors[at(expected) - 1]) --expected;  // a step that gains nothing is not taken
    EXPECT_GT(expected, 1) << "one step is not enough";
    EXPECT_LT(expected, kMost);
    EXPECT_LE(errors.back(), 4 * kEps);
    EXPECT_EQ(solve(50).refinement_steps, expected);
  }
}

/// A regular system beside two unknowns that depend on each other but for `apart`.
SparseMatrix beside_a_pair(Index n, double diagonal, double coupling, double apart) {
  const SparseMatrix a = reference::random_system(n, 12, reference::Values::positive, 3);
  std::vector<reference::Triple> entries{{n, n, diagonal}, {n + 1, n, coupling}, {n + 1, n + 1, diagonal + apart}};
  for (Index c = 0; c < n; ++c)
    for (Offset q = a.col_ptr[at(c)]; q < a.col_ptr[at(c) + 1]; ++q)
      if (a.row_ind[at(q)] >= c) entries.push_back({a.row_ind[at(q)], c, a.values[at(q)]});
  return reference::from_triples(n + 2, entries, Storage::symmetric_lower);
}

// Columns of a factor that is near to singular lose what the change gives: the changed matrix itself has to be
// factorized, which a caller may refuse.
TEST(ChangedWork, AFactorNearToSingularIsMadeAnew) {
  const SparseMatrix a = beside_a_pair(2500, 1, 1, 4e-14);
  Solver solver = factorized(a, Kind::llt);
  Dense dense(a);
  std::vector<Index> gone;
  for (Index v = 0; v < 40; ++v) gone.push_back(v);
  gone.insert(gone.end(), {2500, 2501});
  for (const bool folds : {true, false}) {
    ChangedSystem changed(solver);
    changed.set_folding(folds);
    ASSERT_TRUE(changed.remove(gone).ok());
    std::vector<double> b = reference::random_vector(a.cols, 1), x(b.size());
    const ChangedSolveResult r = changed.solve(b, x);
    if (!folds) {
      EXPECT_EQ(r.status.code, StatusCode::singular) << r.status.message;
      EXPECT_LT(r.cost.changes, r.cost.factorization) << "or it would be made anew for its cost";
      continue;
    }
    ASSERT_TRUE(r.status.ok()) << r.status.message;
    EXPECT_EQ(r.cost.factorizations, 1);
    EXPECT_LE(r.backward_error, 100 * kEps);
    std::vector<double> of_b, of_x;
    for (Index v = 0; v < a.cols; ++v)
      if (std::find(gone.begin(), gone.end(), v) == gone.end()) {
        of_b.push_back(b[at(v)]);
        of_x.push_back(x[at(v)]);
      }
    EXPECT_LE(reference::backward_error(dense.without(gone), of_b, of_x), 100 * kEps);
  }
}

// Where the error is above what is asked for, too, and b is where x goes.
TEST(ChangedWork, AnErrorAboveTheLimitFactorizes) {
  const SparseMatrix a = beside_a_pair(1200, 1e-20, 0, 1);
  Solver solver = factorized(a, Kind::llt);
  const std::vector<double> b = reference::random_vector(a.cols, 1);
  std::vector<double> u(b.size(), 0.0);
  u[1200] = u[1201] = u[3] = 1;
  Dense dense(a);
  for (const Index r : {3, 1200, 1201})
    for (const Index c : {3, 1200, 1201}) dense.entry(r, c) += 1;
  for (const bool folds : {true, false}) {
    ChangedSystem changed(solver);
    changed.set_folding(folds);
    ASSERT_TRUE(changed.add_low_rank(u, 1).ok());
    std::vector<double> x(b);
    const ChangedSolveResult r = changed.solve(x, x);
    EXPECT_EQ(r.cost.factorizations, folds ? 1 : 0);
    if (!folds) {
      EXPECT_EQ(r.status.code, StatusCode::accuracy_not_reached) << r.status.message;
      continue;
    }
    ASSERT_TRUE(r.status.ok()) << r.status.message;
    EXPECT_LE(reference::backward_error(dense.without({}), b, x, 1, false), 100 * kEps);
  }
}

// A constraint that is removed leaves an identity of some size in a factor of the changed matrix; so does a row without
// entries.
TEST(ChangedWork, RemovedRowsWithoutADiagonalFold) {
  const SparseMatrix a = reference::random_system(60, 4, reference::Values::positive, 5);
  Solver solver = factorized(a, Kind::llt);
  ChangedSystem changed(solver);
  Dense dense(a);
  ASSERT_TRUE(changed.add(reference::random_vector(60, 8), 1).ok());
  dense.grow(1);
  for (Index v = 0; v < 60; ++v) dense.entry(v, 60) = dense.entry(60, v) = reference::random_vector(60, 8)[at(v)];
  ASSERT_TRUE(changed.remove(std::vector<Index>{60}).ok());
  ASSERT_TRUE(changed.fold().ok());
  expect_solves(changed, dense, {60}, true);
  ASSERT_TRUE(changed.restore(std::vector<Index>{60}).ok());
  expect_solves(changed, dense, {}, true);
  // A replaced unknown without an entry of its own.
  Entries column;
  std::vector<double> others = reference::random_vector(61, 12);
  others[7] = 0;
  column.add_column(others, 1);
  ASSERT_TRUE(changed.replace(std::vector<Index>{7}, column.columns()).ok());
  for (Index v = 0; v < 61; ++v) dense.entry(v, 7) = dense.entry(7, v) = others[at(v)];
  expect_solves(changed, dense, {}, true);
}

TEST(ChangedWork, CostsAndMisuse) {
  const SparseMatrix a = reference::random_system(400, 4, reference::Values::positive, 5);
  Solver solver = factorized(a, Kind::llt);
  ChangedSystem changed(solver);
  EXPECT_GT(changed.cost().factorization_seconds, 0);
  const double same_pattern = changed.cost().factorization;
  const std::vector<double> g(400, 1.0);
  EXPECT_THROW((void)changed.add(g, 1, {}, std::vector<double>(2)), std::invalid_argument);
  Entries one, two;
  one.add_column(g, 1);
  for (int k = 0; k < 2; ++k) two.add_column(g, 1);
  EXPECT_THROW((void)changed.add(one.columns(), {}, std::vector<double>(2)), std::invalid_argument);
  EXPECT_THROW((void)changed.add(one.columns(), two.columns()), std::invalid_argument);
  EXPECT_THROW((void)changed.add_low_rank(one.columns(), {}, two.columns()), std::invalid_argument);
  EXPECT_THROW((void)changed.add_low_rank(one.columns(), std::vector<double>(4)), std::invalid_argument);
  ASSERT_TRUE(changed.add(g, 1).ok());
  EXPECT_GT(changed.cost().factorization, same_pattern) << "the pattern has to be analysed";
  std::vector<double> b(401, 1.0), x(401);
  const ChangedSolveResult r = changed.solve(b, x);
  ASSERT_TRUE(r.status.ok());
  EXPECT_GT(r.cost.column_seconds, 0);
  EXPECT_LE(r.cost.column_seconds, r.seconds);
  ASSERT_TRUE(solver.analyze(reference::random_system(50, 3, reference::Values::positive, 1)).status.ok());
  EXPECT_THROW((void)changed.solve(b, x), std::logic_error) << "its factor has gone";
}

}  // namespace changed_work_test

}  // namespace espalier::test

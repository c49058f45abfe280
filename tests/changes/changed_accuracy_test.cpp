// What a changed system reports of its errors. Truth: dense matrices changed as said,
// and their residuals.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <stdexcept>
#include <vector>

#include "changes/dense_changes.hpp"

namespace espalier::test {

namespace changed_accuracy_test {

using namespace changed;
/// Some row or column of each change is much larger than the others, so that norms come and go with it.
class RoughChanges {
 public:
  RoughChanges(bool symmetric, std::uint64_t seed) : symmetric_(symmetric), dense_(matrix(symmetric, seed)) {
    Options o = rough();
    o.kind = symmetric ? Kind::llt : Kind::lu;
    solver_.emplace(o);
    EXPECT_TRUE(solver_->analyze(a_).status.ok());
    EXPECT_TRUE(solver_->factorize(a_).status.ok());
    changed_.emplace(*solver_);
    changed_->set_folding(false);
  }

  /// A removed row that was the largest, or changes one after another.
  void remove(const std::vector<Index>& list) {
    ASSERT_TRUE(changed_->remove(list).ok());
    removed_.insert(removed_.end(), list.begin(), list.end());
    expect_reported_errors();
  }
  void add(double column_size, double row_size, std::uint64_t seed) {
    std::vector<double> column = reference::random_vector(kN, seed), row = reference::random_vector(kN, seed + 1);
    for (double& x : column) x *= column_size;
    for (double& x : row) x *= row_size;
    if (symmetric_) row = column;
    add(column, row);
  }
  /// Entries of exactly 1 count like all others.
  void add_ones() { add(std::vector<double>(kN, 1.0), std::vector<double>(kN, 1.0)); }
  void add(const std::vector<double>& column, const std::vector<double>& row) {
    const std::vector<double> corner{-2.5};
    ASSERT_TRUE(changed_->add(column, 1, symmetric_ ? std::span<const double>{} : row, corner).ok());
    dense_.grow(1);
    for (Index v = 0; v < kN; ++v) {
      dense_.entry(v, dense_.n - 1) = column[at(v)];
      dense_.entry(dense_.n - 1, v) = row[at(v)];
    }
    dense_.entry(dense_.n - 1, dense_.n - 1) = corner[0];
    expect_reported_errors();
  }
  void add_low_rank(double weight, std::uint64_t seed) {
    const std::vector<double> u = reference::random_vector(kN, seed);
    const std::vector<double> v = symmetric_ ? u : reference::random_vector(kN, seed + 1);
    ASSERT_TRUE(changed_->add_low_rank(u, 1, std::vector<double>{weight}, v).ok());
    for (Index c = 0; c < kN; ++c)
      for (Index r = 0; r < kN; ++r) dense_.entry(r, c) += weight * u[at(r)] * v[at(c)];
    expect_reported_errors();
  }
  void fold() {
    ASSERT_TRUE(changed_->fold().ok());
    expect_reported_errors();
  }

  static constexpr Index kN = 60, kLargeRow = 17, kLargeColumn = 23;

 private:
  Dense matrix(bool symmetric, std::uint64_t seed) {
    a_ = reference::random_system(kN, 4, reference::Values::positive, seed);
    if (!symmetric) {
      a_ = reference::stored_as(a_, Storage::general);
      for (Index c = 0; c < kN; ++c)
        for (Offset q = a_.col_ptr[at(c)]; q < a_.col_ptr[at(c) + 1]; ++q)
          a_.values[at(q)] *= (a_.row_ind[at(q)] == kLargeRow ? 300 : 1) * (c == kLargeColumn ? 200 : 1);
    }
    return Dense(a_);
  }

  void expect_reported_errors() {
    const SparseMatrix left = dense_.without(removed_);
    for (const bool transpose : {false, true}) {
      const std::vector<double> b = reference::random_vector(dense_.n, 9);
      std::vector<double> x(b.size()), b_left, x_left;
      const ChangedSolveResult r = changed_->solve(b, x, 1, transpose ? Transpose::yes : Transpose::no);
      ASSERT_TRUE(r.status.ok()) << r.status.message;
      EXPECT_TRUE(std::isnan(r.componentwise_error)) << "nobody forms it";
      EXPECT_EQ(r.refinement_steps, 0);
      for (Index v = 0; v < dense_.n; ++v)
        if (std::find(removed_.begin(), removed_.end(), v) == removed_.end()) {
          b_left.push_back(b[at(v)]);
          x_left.push_back(x[at(v)]);
        }
      const double error = reference::backward_error(left, b_left, x_left, 1, transpose);
      EXPECT_GT(error, 1e-13) << "there is something to report";
      EXPECT_LT(error, 1e-5) << "but it is solved";
      EXPECT_NEAR(r.backward_error, error, 1e-6 * error) << "transpose " << transpose;
    }
  }

  bool symmetric_;
  SparseMatrix a_;
  Dense dense_;
  std::optional<Solver> solver_;
  std::optional<ChangedSystem> changed_;
  std::vector<Index> removed_;
};

TEST(ChangedAccuracy, ErrorsAreReportedWithNormsThatComeAndGo) {
  for (const bool symmetric : {true, false})
    for (const bool folds : {false, true}) {
      SCOPED_TRACE(testing::Message() << "symmetric " << symmetric << ", folds " << folds);
      RoughChanges ones(true, 5);
      ones.add_ones();
      if (folds) ones.fold();
      ones.remove({3});
      RoughChanges changes(symmetric, 5);
      changes.remove({RoughChanges::kLargeRow});
      changes.remove({RoughChanges::kLargeColumn, 2});
      changes.add_low_rank(40, 7);
      if (folds) changes.fold();
      changes.add(1, 50, 11);
      changes.add(80, 1, 13);
      if (folds) changes.fold();
      changes.add_low_rank(-300, 15);
      changes.remove({RoughChanges::kN, 40});
      if (folds) changes.fold();
      changes.add(3, 2, 17);
    }
}

// Norms of more rows than are kept in the order of their sums.
TEST(ChangedAccuracy, ErrorsOfManyRowsAreReported) {
  const Index n = 9000;
  std::vector<reference::Triple> entries;
  for (Index i = 0; i < n; ++i) {
    entries.push_back({i, i, i == 8700 ? 100.0 : 4 + 0.1 * (i % 97)});
    if (i > 0) entries.push_back({i, i - 1, -1 - 0.01 * (i % 13)});
  }
  const SparseMatrix a = reference::from_triples(n, entries, Storage::symmetric_lower);
  Options o = rough();
  o.kind = Kind::llt;
  Solver solver(o);
  ASSERT_TRUE(solver.analyze(a).status.ok());
  ASSERT_TRUE(solver.factorize(a).status.ok());
  ChangedSystem changed(solver);
  changed.set_folding(false);
  const std::vector<double> b = reference::random_vector(n, 3);
  std::vector<double> x(b.size());
  for (const Index gone : {3000, 8700}) {
    ASSERT_TRUE(changed.remove(std::vector<Index>{gone}).ok());
    const ChangedSolveResult r = changed.solve(b, x);
    ASSERT_TRUE(r.status.ok()) << r.status.message;
    // Without the row and column: an identity in their place, of which nothing is left.
    double rest = 0, size = 0, norm = 0, given = 0;
    std::vector<double> product(b.size(), 0.0), sums(b.size(), 0.0);
    for (Index c = 0; c < n; ++c)
      for (Offset q = a.col_ptr[at(c)]; q < a.col_ptr[at(c) + 1]; ++q) {
        const Index row = a.row_ind[at(q)];
        if (changed.removed(row) || changed.removed(c)) continue;
        product[at(row)] += a.values[at(q)] * x[at(c)];
        sums[at(row)] += std::abs(a.values[at(q)]);
        if (row == c) continue;
        product[at(c)] += a.values[at(q)] * x[at(row)];
        sums[at(c)] += std::abs(a.values[at(q)]);
      }
    for (Index v = 0; v < n; ++v) {
      if (changed.removed(v)) continue;
      rest = std::max(rest, std::abs(b[at(v)] - product[at(v)]));
      size = std::max(size, std::abs(x[at(v)]));
      norm = std::max(norm, sums[at(v)]);
      given = std::max(given, std::abs(b[at(v)]));
    }
    const double error = rest / (norm * size + given);
    EXPECT_GT(error, 1e-11);
    EXPECT_LT(error, 1e-5);
    EXPECT_NEAR(r.backward_error, error, 1e-3 * error) << gone;
  }
}

}  // namespace changed_accuracy_test

}  // namespace espalier::test

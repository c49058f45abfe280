// Truth: dense systems that are changed as said, solved by Eigen; eigenvalues for the inertia.
#include "espalier/changed_system.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "base/at.hpp"
#include "reference/reference.hpp"

namespace espalier::test {

namespace {

constexpr double kEps = std::numeric_limits<double>::epsilon();

/// A dense square matrix, column-major, that is changed beside the object under test.
struct Dense {
  Index n = 0;
  std::vector<double> a;

  explicit Dense(const MatrixView& m) : n(m.cols), a(reference::dense(m)) {}
  double& entry(Index r, Index c) { return a[at(c) * at(n) + at(r)]; }
  void grow(Index more) {
    Dense old = *this;
    n += more;
    a.assign(at(n) * at(n), 0.0);
    for (Index c = 0; c < old.n; ++c)
      for (Index r = 0; r < old.n; ++r) entry(r, c) = old.entry(r, c);
  }
  [[nodiscard]] SparseMatrix without(const std::vector<Index>& removed) {
    std::vector<Index> kept;
    for (Index v = 0; v < n; ++v)
      if (std::find(removed.begin(), removed.end(), v) == removed.end()) kept.push_back(v);
    std::vector<reference::Triple> t;
    for (std::size_t c = 0; c < kept.size(); ++c)
      for (std::size_t r = 0; r < kept.size(); ++r)
        if (const double v = entry(kept[r], kept[c]); v != 0)
          t.push_back({static_cast<Index>(r), static_cast<Index>(c), v});
    return reference::from_triples(static_cast<Index>(kept.size()), t, Storage::general);
  }
};

Solver factorized(const SparseMatrix& a, Kind kind) {
  Options o;
  o.kind = kind;
  o.threads = 2;
  Solver s(o);
  EXPECT_TRUE(s.analyze(a).status.ok());
  EXPECT_TRUE(s.factorize(a).status.ok());
  return s;
}

void expect_solves(ChangedSystem& changed, Dense& dense, const std::vector<Index>& removed, bool symmetric) {
  ASSERT_EQ(changed.size(), dense.n);
  const SparseMatrix left = dense.without(removed);
  const std::vector<double> b = reference::random_vector(2 * dense.n, 3);
  std::vector<double> x(b);
  const SolveResult r = changed.solve(x, x, 2);
  if (r.status.code == StatusCode::singular) {
    EXPECT_TRUE(reference::determinant(left).sign == 0 || !(reference::condition(left) < 1e13));
    return;
  }
  ASSERT_TRUE(r.status.ok()) << r.status.message;
  std::vector<double> b_left, x_left;
  for (Index c = 0; c < 2; ++c)
    for (Index v = 0; v < dense.n; ++v) {
      const std::size_t k = at(c) * at(dense.n) + at(v);
      if (std::find(removed.begin(), removed.end(), v) != removed.end()) {
        EXPECT_EQ(x[k], 0);
        continue;
      }
      b_left.push_back(b[k]);
      x_left.push_back(x[k]);
    }
  const double error = reference::backward_error(left, b_left, x_left, 2);
  EXPECT_LE(error, 100 * kEps);
  EXPECT_GE(r.backward_error, error / 4 - kEps) << "the reported error is too small";
  EXPECT_LE(r.backward_error, 10 * error + 4 * kEps);
  const Inertia inertia = changed.inertia();
  if (!symmetric) {
    EXPECT_EQ(inertia.positive, -1);
    return;
  }
  const reference::Signs signs = reference::signs(left, 1e-13);
  EXPECT_EQ(inertia.positive, signs.positive);
  EXPECT_EQ(inertia.negative, signs.negative);
  EXPECT_EQ(inertia.zero, signs.zero);
}

// Everything that can be done, in random order.
void change_at_random(const SparseMatrix& a, Kind kind, std::uint64_t seed) {
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  Solver solver = factorized(a, kind);
  ChangedSystem changed(solver);
  Dense dense(a);
  std::vector<Index> removed;
  bool symmetric = kind != Kind::lu;
  std::mt19937_64 random(seed);
  const Index n = a.cols;
  for (int step = 0; step < 8; ++step) {
    const auto what = random() % 4;
    const auto count = static_cast<Index>(1 + random() % 3);
    if (what == 0) {
      const bool both = random() % 3 != 0;
      const std::vector<double> u = reference::random_vector(n * count, random()),
                                other = reference::random_vector(n * count, random());
      ASSERT_TRUE(changed.add(u, count, both ? std::span<const double>{} : other).ok());
      dense.grow(count);
      for (Index k = 0; k < count; ++k)
        for (Index v = 0; v < n; ++v) {
          dense.entry(v, dense.n - count + k) = u[at(k) * at(n) + at(v)];
          dense.entry(dense.n - count + k, v) = (both ? u : other)[at(k) * at(n) + at(v)];
        }
      symmetric = symmetric && both;
    } else if (what == 1) {
      const auto v = static_cast<Index>(random() % static_cast<std::uint64_t>(dense.n));
      const bool gone = std::find(removed.begin(), removed.end(), v) != removed.end();
      EXPECT_EQ(changed.remove(std::vector<Index>{v}).ok(), !gone);
      if (!gone) removed.push_back(v);
    } else if (what == 2 && !removed.empty()) {
      ASSERT_TRUE(changed.restore(std::vector<Index>{removed.front()}).ok());
      removed.erase(removed.begin());
    } else {
      const bool both = random() % 3 != 0;
      const std::vector<double> u = reference::random_vector(n * count, random()),
                                v = both ? u : reference::random_vector(n * count, random());
      std::vector<double> c = reference::random_vector(count * count, random());
      if (both)
        for (Index i = 0; i < count; ++i)
          for (Index j = 0; j < i; ++j) c[at(j) * at(count) + at(i)] = c[at(i) * at(count) + at(j)];
      ASSERT_TRUE(changed.add_low_rank(u, count, c, both ? std::span<const double>{} : v).ok());
      for (Index i = 0; i < count; ++i)
        for (Index j = 0; j < count; ++j)
          for (Index r = 0; r < n; ++r)
            for (Index k = 0; k < n; ++k)
              dense.entry(r, k) += u[at(i) * at(n) + at(r)] * c[at(j) * at(count) + at(i)] * v[at(j) * at(n) + at(k)];
      symmetric = symmetric && both;
    }
    expect_solves(changed, dense, removed, symmetric);
  }
}

TEST(ChangedSystem, IsTheSystemThatWasChanged) {
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    const auto n = static_cast<Index>(12 + 9 * seed);
    change_at_random(reference::random_system(n, 3, reference::Values::positive, seed), Kind::llt, seed);
    change_at_random(reference::random_system(n, 3, reference::Values::indefinite, seed), Kind::ldlt, seed);
    change_at_random(reference::random_system(n, 3, reference::Values::general, seed), Kind::lu, seed);
    change_at_random(reference::saddle_point(n, n / 4, seed), Kind::ldlt, seed);
  }
}

TEST(ChangedSystem, ConstraintsOfKktSystemsComeAndGo) {
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

TEST(ChangedSystem, ASingularChangeIsSaid) {
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
TEST(ChangedSystem, AnEmptyRowBesideOthersIsSingular) {
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

TEST(ChangedSystem, ChangesOfNothingAndSingularCores) {
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

TEST(ChangedSystem, MisuseAndBadNumbersAreErrors) {
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
  ASSERT_TRUE(solver.factorize(a).status.ok());
  EXPECT_THROW((void)changed.solve(x, x), std::logic_error);
  changed.reset();
  EXPECT_TRUE(changed.solve(x, x).status.ok());
}

}  // namespace

}  // namespace espalier::test

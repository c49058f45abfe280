/// \file
/// A dense matrix that is changed beside the object under test, and columns of entries for that.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "base/at.hpp"
#include "device/registry.hpp"
#include "espalier/changed_system.hpp"
#include "reference/reference.hpp"

namespace espalier::test::changed {

inline constexpr double kEps = std::numeric_limits<double>::epsilon();

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

/// Columns of entries, with the rows of each in a random order and one of them in two parts.
struct Entries {
  std::vector<Offset> ptr{0};
  std::vector<Index> rows;
  std::vector<double> values;

  void add_column(const std::vector<double>& column, std::uint64_t seed) {
    std::vector<Index> order;
    for (std::size_t i = 0; i < column.size(); ++i)
      if (column[i] != 0) order.push_back(static_cast<Index>(i));
    std::shuffle(order.begin(), order.end(), std::mt19937_64(seed));
    for (std::size_t k = 0; k < order.size(); ++k) {
      const double v = column[at(order[k])];
      rows.push_back(order[k]);
      values.push_back(k == 0 ? v / 2 : v);
    }
    if (!order.empty()) {
      rows.push_back(order.front());
      values.push_back(column[at(order.front())] / 2);
    }
    ptr.push_back(static_cast<Offset>(rows.size()));
  }
  [[nodiscard]] SparseColumns columns() const { return {ptr, rows, values}; }
};

inline Solver factorized(const SparseMatrix& a, Kind kind, const std::string& device = "cpu") {
  Options o;
  o.device = device;
  o.kind = kind;
  o.threads = 2;
  Solver s(o);
  EXPECT_TRUE(s.analyze(a).status.ok());
  EXPECT_TRUE(s.factorize(a).status.ok());
  return s;
}

/// Factors in single precision, solutions as they come: errors far above rounding.
inline Options rough() {
  Options o;
  o.device = "cpu";
  o.threads = 2;
  o.precision = Precision::fp32;
  o.refinement_steps = 0;
  o.required_backward_error = std::numeric_limits<double>::infinity();
  return o;
}

// A x = b or A^T x = b, by the residual with the dense matrix; whether there was a solution.
inline bool solves(ChangedSystem& changed, Dense& dense, const std::vector<Index>& removed, Transpose transpose) {
  EXPECT_EQ(changed.size(), dense.n);
  const SparseMatrix left = dense.without(removed);
  const std::vector<double> b = reference::random_vector(2 * dense.n, 3);
  std::vector<double> x(b);
  const SolveResult r = changed.solve(x, x, 2, transpose);
  if (r.status.code == StatusCode::singular) {
    EXPECT_TRUE(reference::determinant(left).sign == 0 || !(reference::condition(left) < 1e13));
    return false;
  }
  EXPECT_TRUE(r.status.ok()) << r.status.message;
  if (!r.status.ok()) return false;
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
  const double error = reference::backward_error(left, b_left, x_left, 2, transpose != Transpose::no);
  EXPECT_LE(error, 100 * kEps);
  EXPECT_GE(r.backward_error, error / 4 - kEps) << "the reported error is too small";
  EXPECT_LE(r.backward_error, 10 * error + 4 * kEps);
  return true;
}

inline void expect_solves(ChangedSystem& changed, Dense& dense, const std::vector<Index>& removed, bool symmetric) {
  if (!solves(changed, dense, removed, Transpose::no)) return;
  if (!solves(changed, dense, removed, Transpose::yes)) return;
  const SparseMatrix left = dense.without(removed);
  const Inertia inertia = changed.inertia();
  if (!symmetric && inertia.positive == -1) return;
  Dense of_left(left);
  for (Index row = 0; row < left.cols && !symmetric; ++row)  // what was not symmetric has gone
    for (Index c = 0; c < row; ++c) ASSERT_NEAR(of_left.entry(row, c), of_left.entry(c, row), 1e-12);
  const reference::Signs signs = reference::signs(left, 1e-13);
  EXPECT_EQ(inertia.positive, signs.positive);
  EXPECT_EQ(inertia.negative, signs.negative);
  EXPECT_EQ(inertia.zero, signs.zero);
}

}  // namespace espalier::test::changed

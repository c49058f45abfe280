// The C interface of changes around a factor. Truth: the C++ one, and a dense solve.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "base/at.hpp"
#include "espalier/espalier.h"
#include "reference/reference.hpp"

namespace espalier::test {

namespace {

struct CSolver {
  espalier_solver* s = nullptr;
  espalier_changed* c = nullptr;
  explicit CSolver(const SparseMatrix& a, int storage = ESPALIER_SYMMETRIC_LOWER, int layout = ESPALIER_CSC) {
    EXPECT_EQ(espalier_create(&s), ESPALIER_OK);
    std::vector<std::int64_t> pointers(a.col_ptr.begin(), a.col_ptr.end()), indices(a.row_ind.begin(), a.row_ind.end());
    espalier_matrix_i64 m{};
    m.size = sizeof m;
    m.rows = m.cols = a.cols;
    m.nonzeros = a.nonzeros();
    m.pointers = pointers.data();
    m.indices = indices.data();
    m.values = a.values.data();
    m.storage = storage;
    m.layout = layout;
    EXPECT_EQ(espalier_analyze_i64(s, &m, nullptr), ESPALIER_OK) << espalier_last_error(s);
    EXPECT_EQ(espalier_factorize_i64(s, &m, nullptr), ESPALIER_OK) << espalier_last_error(s);
  }
  CSolver(const CSolver&) = delete;
  CSolver& operator=(const CSolver&) = delete;
  ~CSolver() {
    espalier_changed_destroy(c);
    espalier_destroy(s);
  }
};

TEST(CChanged, RowsComeAndGo) {
  const SparseMatrix a = reference::random_system(30, 3, reference::Values::positive, 1);
  CSolver solver(a);
  ASSERT_EQ(espalier_changed_create(solver.s, &solver.c), ESPALIER_OK) << espalier_last_error(solver.s);
  const std::int64_t begin[2] = {0, 2}, rows[2] = {4, 20}, gone[2] = {7, 9};
  const double values[2] = {1, -1}, corner = -0.5;
  const espalier_columns column{1, begin, rows, values};
  ASSERT_EQ(espalier_changed_add(solver.c, &column, nullptr, &corner), ESPALIER_OK) << espalier_last_error(solver.s);
  ASSERT_EQ(espalier_changed_flip(solver.c, gone, 2), ESPALIER_OK);
  ASSERT_EQ(espalier_changed_restore(solver.c, gone, 1), ESPALIER_OK);
  ASSERT_EQ(espalier_changed_add_low_rank(solver.c, &column, nullptr, nullptr), ESPALIER_OK);
  std::int64_t size = 0, inertia[3];
  ASSERT_EQ(espalier_changed_size(solver.c, &size), ESPALIER_OK);
  ASSERT_EQ(size, 31);
  std::vector<double> b = reference::random_vector(31, 5), x(31);
  // A dense truth of 30 rows: without row 9.
  std::vector<double> dense = reference::dense(a);
  std::vector<reference::Triple> t;
  const auto kept = [](Index v) { return v < 9 ? v : v - 1; };
  const double u[2] = {1, -1};
  const Index places[2] = {4, 20};
  for (int i = 0; i < 2; ++i)
    for (int j = 0; j < 2; ++j) dense[at(places[j]) * 30 + at(places[i])] += u[i] * u[j];
  std::vector<double> right;
  for (Index c = 0; c < 31; ++c) {
    if (c == 9) continue;
    right.push_back(b[at(c)]);
    for (Index r = 0; r < 31; ++r) {
      if (r == 9) continue;
      double v = 0;
      if (r < 30 && c < 30)
        v = dense[at(c) * 30 + at(r)];
      else if (r == 30 && c == 30)
        v = corner;
      else
        v = std::min(r, c) == 4 ? 1 : std::min(r, c) == 20 ? -1 : 0;
      if (v != 0) t.push_back({kept(r), kept(c), v});
    }
  }
  const std::vector<double> truth = reference::solve(reference::from_triples(30, t, Storage::general), right, 1, false);
  for (const bool folds : {false, true}) {
    if (folds) {
      ASSERT_EQ(espalier_changed_fold(solver.c), ESPALIER_OK) << espalier_last_error(solver.s);
    }
    espalier_solve_info info{};
    info.size = sizeof info;
    ASSERT_EQ(espalier_changed_solve(solver.c, b.data(), x.data(), 31, 1, ESPALIER_NO_TRANSPOSE, &info), ESPALIER_OK)
        << espalier_last_error(solver.s);
    EXPECT_LT(info.backward_error, 1e-14);
    for (Index v = 0; v < 31; ++v) EXPECT_NEAR(x[at(v)], v == 9 ? 0 : truth[at(kept(v))], 1e-10) << v;
  }
  ASSERT_EQ(espalier_changed_inertia(solver.c, inertia), ESPALIER_OK);
  EXPECT_EQ(inertia[0], 29);
  EXPECT_EQ(inertia[1], 1);
  espalier_change_cost cost{};
  cost.size = sizeof cost;
  ASSERT_EQ(espalier_changed_cost(solver.c, &cost), ESPALIER_OK);
  EXPECT_EQ(cost.factorizations, 1);
  EXPECT_GT(cost.factorization, 0);
}

// Unsymmetric, by columns and by rows: every change, and solves with A and A^T. Truth: the dense matrix.
TEST(CChanged, TransposesOfEitherLayout) {
  constexpr Index n = 24;
  SparseMatrix a =
      reference::stored_as(reference::random_system(n, 4, reference::Values::positive, 5), Storage::general);
  for (Index c = 0; c < n; ++c)  // unsymmetric; regular without a row and a column
    for (Offset q = a.col_ptr[at(c)]; q < a.col_ptr[at(c) + 1]; ++q)
      if (a.row_ind[at(q)] > c) a.values[at(q)] *= 0.3;
  const SparseMatrix by_rows = [&] {
    std::vector<reference::Triple> t;
    for (Index c = 0; c < n; ++c)
      for (Offset q = a.col_ptr[at(c)]; q < a.col_ptr[at(c) + 1]; ++q)
        t.push_back({c, a.row_ind[at(q)], a.values[at(q)]});
    return reference::from_triples(n, t, Storage::general);
  }();
  constexpr Index all = n + 2;
  for (const int layout : {ESPALIER_CSC, ESPALIER_CSR}) {
    CSolver solver(layout == ESPALIER_CSC ? a : by_rows, ESPALIER_GENERAL, layout);
    ASSERT_EQ(espalier_changed_create(solver.s, &solver.c), ESPALIER_OK) << espalier_last_error(solver.s);
    std::vector<double> dense(at(all) * at(all), 0.0);
    const std::vector<double> of_a = reference::dense(a);
    const auto entry = [&](Index r, Index c) -> double& { return dense[at(c) * at(all) + at(r)]; };
    for (Index c = 0; c < n; ++c)
      for (Index r = 0; r < n; ++r) entry(r, c) = of_a[at(c) * at(n) + at(r)];
    const std::int64_t begin[3] = {0, 2, 4}, rows[4] = {4, 20, 1, 7}, other_rows[4] = {3, 9, 11, 2};
    const double values[4] = {1, -1, 0.5, 2}, other_values[4] = {2, 0.25, -1, 3};
    const double corner[4] = {-0.5, 0.3, 0.7, 2};  // by columns
    const espalier_columns two{2, begin, rows, values}, others{2, begin, other_rows, other_values};
    ASSERT_EQ(espalier_changed_add_low_rank(solver.c, &two, corner, &others), ESPALIER_OK);
    for (int i = 0; i < 2; ++i)
      for (int j = 0; j < 2; ++j)
        for (int p = 2 * i; p < 2 * i + 2; ++p)
          for (int q = 2 * j; q < 2 * j + 2; ++q)
            entry(static_cast<Index>(rows[p]), static_cast<Index>(other_rows[q])) +=
                values[p] * corner[2 * j + i] * other_values[q];
    ASSERT_EQ(espalier_changed_add(solver.c, &two, &others, corner), ESPALIER_OK) << espalier_last_error(solver.s);
    for (int i = 0; i < 2; ++i) {
      for (int p = 2 * i; p < 2 * i + 2; ++p) {
        entry(static_cast<Index>(rows[p]), n + i) = values[p];
        entry(n + i, static_cast<Index>(other_rows[p])) = other_values[p];
      }
      for (int j = 0; j < 2; ++j) entry(n + i, n + j) = corner[2 * j + i];
    }
    const std::int64_t replaced[1] = {5}, column_begin[2] = {0, 3}, column_rows[3] = {5, 8, 24}, row_begin[2] = {0, 1},
                       row_rows[1] = {12};
    const double column_values[3] = {4, 1, -2}, row_values[1] = {1.5};
    const espalier_columns column{1, column_begin, column_rows, column_values}, row{1, row_begin, row_rows, row_values};
    ASSERT_EQ(espalier_changed_replace(solver.c, replaced, 1, &column, &row), ESPALIER_OK);
    for (Index k = 0; k < all; ++k) entry(k, 5) = entry(5, k) = 0;
    for (int k = 0; k < 3; ++k) entry(static_cast<Index>(column_rows[k]), 5) = column_values[k];
    entry(5, 12) = 1.5;
    for (const bool folds : {false, true})
      for (const int t : {ESPALIER_NO_TRANSPOSE, ESPALIER_TRANSPOSE, ESPALIER_CONJUGATE_TRANSPOSE}) {
        if (folds) {
          ASSERT_EQ(espalier_changed_fold(solver.c), ESPALIER_OK) << espalier_last_error(solver.s);
        }
        const std::vector<double> b = reference::random_vector(all, 5);
        std::vector<double> x(b.size());
        espalier_solve_info info{};
        info.size = sizeof info;
        ASSERT_EQ(espalier_changed_solve(solver.c, b.data(), x.data(), all, 1, t, &info), ESPALIER_OK)
            << espalier_last_error(solver.s);
        EXPECT_LT(info.backward_error, 1e-14);
        for (Index r = 0; r < all; ++r) {
          double sum = -b[at(r)];
          for (Index c = 0; c < all; ++c) sum += (t == ESPALIER_NO_TRANSPOSE ? entry(r, c) : entry(c, r)) * x[at(c)];
          EXPECT_NEAR(sum, 0, 1e-10) << "layout " << layout << ", transpose " << t << ", row " << r;
        }
      }
  }
}

TEST(CChanged, MisuseIsSaid) {
  EXPECT_EQ(espalier_changed_solve(nullptr, nullptr, nullptr, 0, 1, ESPALIER_NO_TRANSPOSE, nullptr), ESPALIER_MISUSE);
  const SparseMatrix a = reference::random_system(10, 3, reference::Values::positive, 1);
  CSolver solver(a);
  EXPECT_EQ(espalier_changed_create(solver.s, nullptr), ESPALIER_MISUSE);
  ASSERT_EQ(espalier_changed_create(solver.s, &solver.c), ESPALIER_OK);
  const std::int64_t far[1] = {std::int64_t{1} << 40}, three[2] = {3, 3};
  EXPECT_EQ(espalier_changed_remove(solver.c, far, 1), ESPALIER_INVALID_INPUT);
  EXPECT_EQ(espalier_changed_remove(solver.c, three, 2), ESPALIER_INVALID_INPUT);
  EXPECT_EQ(espalier_last_error_row(solver.s), 3);
  EXPECT_EQ(espalier_changed_remove(solver.c, nullptr, 1), ESPALIER_MISUSE);
  EXPECT_EQ(espalier_changed_add(solver.c, nullptr, nullptr, nullptr), ESPALIER_MISUSE);
  std::vector<double> b(10, 1.0), x(10);
  EXPECT_EQ(espalier_changed_solve(solver.c, b.data(), x.data(), 9, 1, ESPALIER_NO_TRANSPOSE, nullptr),
            ESPALIER_MISUSE);
  EXPECT_EQ(espalier_changed_solve(solver.c, b.data(), x.data(), 10, 1, 3, nullptr), ESPALIER_MISUSE);
  b[2] = std::nan("");
  EXPECT_EQ(espalier_changed_solve(solver.c, b.data(), x.data(), 10, 1, ESPALIER_NO_TRANSPOSE, nullptr),
            ESPALIER_INVALID_INPUT);
  EXPECT_EQ(espalier_last_error_row(solver.s), 2);
  ASSERT_EQ(espalier_refactorize(solver.s, a.values.data(), a.nonzeros(), nullptr), ESPALIER_OK);
  b[2] = 1;
  EXPECT_EQ(espalier_changed_solve(solver.c, b.data(), x.data(), 10, 1, ESPALIER_NO_TRANSPOSE, nullptr),
            ESPALIER_MISUSE);
  ASSERT_EQ(espalier_changed_reset(solver.c), ESPALIER_OK);
  EXPECT_EQ(espalier_changed_solve(solver.c, b.data(), x.data(), 10, 1, ESPALIER_NO_TRANSPOSE, nullptr), ESPALIER_OK);
}

}  // namespace

}  // namespace espalier::test

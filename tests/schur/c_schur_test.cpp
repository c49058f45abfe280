// Truth: the C++ class, and arithmetic by hand.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "espalier/espalier.h"

namespace {

struct Handles {
  espalier_solver* solver = nullptr;
  espalier_schur* schur = nullptr;
  Handles() {
    EXPECT_EQ(espalier_create(&solver), ESPALIER_OK);
    EXPECT_EQ(espalier_schur_create(solver, &schur), ESPALIER_OK);
  }
  ~Handles() {
    espalier_schur_destroy(schur);
    espalier_destroy(solver);
  }
};

// [4 1 0; 2 5 1; 0 3 6] by rows, 1-based; unsymmetric.
struct Small {
  std::vector<int32_t> pointers{1, 3, 6, 8}, indices{1, 2, 1, 2, 3, 2, 3};
  std::vector<double> values{4, 1, 2, 5, 1, 3, 6};
  espalier_matrix_i32 a{};
  Small() {
    a.size = sizeof a;
    a.rows = a.cols = 3;
    a.nonzeros = 7;
    a.pointers = pointers.data();
    a.indices = indices.data();
    a.values = values.data();
    a.layout = ESPALIER_CSR;
    a.index_base = 1;
  }
};

TEST(CSchur, CondensesByRows) {
  const Handles h;
  const Small m;
  const int64_t list[] = {3, 1};  // 1-based; the rest is unknown 2
  ASSERT_EQ(espalier_schur_analyze_i32(h.schur, &m.a, list, 2, nullptr), ESPALIER_OK);
  espalier_factor_info info{};
  info.size = sizeof info;
  ASSERT_EQ(espalier_schur_factorize(h.schur, m.values.data(), 7, &info), ESPALIER_OK);
  EXPECT_EQ(info.rank, 1);
  double s[4];
  ASSERT_EQ(espalier_schur_complement(h.schur, s, 4), ESPALIER_OK);
  // [6 0; 0 4] - [3; 1] / 5 [1 2]
  EXPECT_DOUBLE_EQ(s[0], 6 - 3.0 / 5);
  EXPECT_DOUBLE_EQ(s[1], -1.0 / 5);
  EXPECT_DOUBLE_EQ(s[2], -6.0 / 5);
  EXPECT_DOUBLE_EQ(s[3], 4 - 2.0 / 5);
  const double b[] = {5, 8, 9};  // of (1, 1, 1)
  double g[2], x[3];
  ASSERT_EQ(espalier_schur_condense(h.schur, b, g, 1, ESPALIER_NO_TRANSPOSE, nullptr), ESPALIER_OK);
  EXPECT_NEAR(g[0], 9 - 3 * 8.0 / 5, 1e-14);
  EXPECT_NEAR(g[1], 5 - 8.0 / 5, 1e-14);
  const double ones[] = {1, 1};
  ASSERT_EQ(espalier_schur_expand(h.schur, b, ones, x, 1, ESPALIER_NO_TRANSPOSE, nullptr), ESPALIER_OK);
  EXPECT_NEAR(x[1], 1, 1e-15);
  ASSERT_EQ(espalier_schur_solve(h.schur, b, x, 1, ESPALIER_NO_TRANSPOSE, nullptr), ESPALIER_OK);
  for (const double v : x) EXPECT_NEAR(v, 1, 1e-15);
  const double bt[] = {6, 9, 7};  // A^T (1, 1, 1)
  ASSERT_EQ(espalier_schur_solve(h.schur, bt, x, 1, ESPALIER_TRANSPOSE, nullptr), ESPALIER_OK);
  for (const double v : x) EXPECT_NEAR(v, 1, 1e-15);
  int64_t rest[3], complement[3];
  ASSERT_EQ(espalier_schur_inertia(h.schur, rest, complement), ESPALIER_OK);
  EXPECT_EQ(complement[0], -1);
}

TEST(CSchur, MisuseIsSaid) {
  EXPECT_EQ(espalier_schur_create(nullptr, nullptr), ESPALIER_MISUSE);
  espalier_schur* none = nullptr;
  EXPECT_EQ(espalier_schur_create(nullptr, &none), ESPALIER_MISUSE);
  espalier_schur_destroy(nullptr);
  const Handles h;
  const Small m;
  double x[3] = {};
  EXPECT_EQ(espalier_schur_factorize(h.schur, m.values.data(), 7, nullptr), ESPALIER_MISUSE);
  EXPECT_EQ(espalier_schur_solve(h.schur, x, x, 1, 0, nullptr), ESPALIER_MISUSE);
  EXPECT_EQ(espalier_schur_analyze_i32(h.schur, &m.a, nullptr, 2, nullptr), ESPALIER_MISUSE);
  EXPECT_EQ(espalier_schur_analyze_i32(h.schur, nullptr, nullptr, 0, nullptr), ESPALIER_MISUSE);
  EXPECT_EQ(espalier_schur_analyze_i32(h.schur, &m.a, nullptr, 0, nullptr), ESPALIER_INVALID_INPUT);
  const int64_t beyond[] = {4}, huge[] = {int64_t{1} << 40}, below[] = {0};
  for (const int64_t* list : {beyond, huge, below})
    EXPECT_EQ(espalier_schur_analyze_i32(h.schur, &m.a, list, 1, nullptr), ESPALIER_INVALID_INPUT);
  EXPECT_NE(std::string(espalier_schur_last_error(h.schur)).find("run from 0 to 2"), std::string::npos);
  const std::vector<int64_t> each_row = {1, 2, 3};  // a list of as many as there can be: what follows it is not read
  for (const int64_t count : {int64_t{4}, int64_t{1} << 40, INT64_MAX})
    EXPECT_EQ(espalier_schur_analyze_i32(h.schur, &m.a, each_row.data(), count, nullptr), ESPALIER_INVALID_INPUT);
  EXPECT_NE(std::string(espalier_schur_last_error(h.schur)).find("matrix has 3 rows"), std::string::npos);
  const int64_t list[] = {1};
  ASSERT_EQ(espalier_schur_analyze_i32(h.schur, &m.a, list, 1, nullptr), ESPALIER_OK);
  EXPECT_EQ(espalier_schur_factorize(h.schur, m.values.data(), 6, nullptr), ESPALIER_MISUSE);
  ASSERT_EQ(espalier_schur_factorize(h.schur, m.values.data(), 7, nullptr), ESPALIER_OK);
  EXPECT_EQ(espalier_schur_complement(h.schur, x, 2), ESPALIER_MISUSE);
  EXPECT_EQ(espalier_schur_condense(h.schur, nullptr, x, 1, 0, nullptr), ESPALIER_MISUSE);
  EXPECT_EQ(espalier_schur_condense(h.schur, x, x, 1, 7, nullptr), ESPALIER_MISUSE);
}

}  // namespace

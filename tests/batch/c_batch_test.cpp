// Truth: arithmetic by hand.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "espalier/espalier.h"

namespace {

TEST(CBatch, SolvesAndNamesFailures) {
  // [a b; 0 c] by rows
  const std::vector<int32_t> pointers{0, 2, 3}, indices{0, 1, 1};
  const std::vector<double> values{2, 1, 4, 1, 3, 5, 0, 0, 0};
  espalier_matrix_i32 a{};
  a.size = sizeof a;
  a.rows = a.cols = 2;
  a.nonzeros = 3;
  a.pointers = pointers.data();
  a.indices = indices.data();
  a.values = values.data();
  a.layout = ESPALIER_CSR;
  espalier_solver* solver = nullptr;
  ASSERT_EQ(espalier_create(&solver), ESPALIER_OK);
  const std::vector<double> b{3, 4, 4, 5, 1, 1};
  std::vector<double> x(6);
  int32_t statuses[3];
  EXPECT_EQ(espalier_solve_batch_i32(solver, &a, values.data(), b.data(), x.data(), 2, 1, 0, statuses), ESPALIER_OK);
  for (int k = 0; k < 4; ++k) EXPECT_DOUBLE_EQ(x[static_cast<std::size_t>(k)], 1);
  EXPECT_EQ(espalier_solve_batch_i32(solver, &a, values.data(), b.data(), x.data(), 3, 1, 0, statuses),
            ESPALIER_SINGULAR);
  EXPECT_EQ(statuses[0], ESPALIER_OK);
  EXPECT_EQ(statuses[2], ESPALIER_SINGULAR);
  EXPECT_TRUE(std::isnan(x[4]));
  EXPECT_NE(std::string(espalier_last_error(solver)).find("system 2"), std::string::npos);
  EXPECT_EQ(espalier_solve_batch_i32(solver, &a, nullptr, b.data(), x.data(), 1, 1, 0, nullptr), ESPALIER_MISUSE);
  EXPECT_EQ(espalier_solve_batch_i32(solver, &a, values.data(), b.data(), x.data(), -1, 1, 0, nullptr),
            ESPALIER_MISUSE);
  EXPECT_EQ(espalier_solve_batch_i32(solver, nullptr, nullptr, nullptr, nullptr, 0, 1, 0, nullptr), ESPALIER_MISUSE);
  EXPECT_EQ(espalier_solve_batch_i32(nullptr, &a, nullptr, nullptr, nullptr, 0, 1, 0, nullptr), ESPALIER_MISUSE);
  espalier_destroy(solver);
}

}  // namespace

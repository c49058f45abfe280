// Work of fronts. The truth is the sum over the columns.
#include <gtest/gtest.h>

#include "plan/plan.hpp"

namespace espalier::plan {
namespace {

TEST(FrontFlops, OfADenseMatrixAreThoseOfTheFormula) {
  // sum over the columns of (rows left)^2; twice that for lu
  for (const Index n : {1, 2, 50, 200}) {
    double sum = 0;
    for (Index k = 1; k <= n; ++k) sum += static_cast<double>(k) * k;
    EXPECT_NEAR(front_flops(n, n, false), sum, 1e-12 * sum);
    EXPECT_NEAR(front_flops(n, n, true), 2 * sum, 2e-12 * sum);
  }
  EXPECT_EQ(front_flops(1, 5, false), 25);
}

}  // namespace
}  // namespace espalier::plan

// The scaling of K where a coordinate has no weight of its own in W.
#include <gtest/gtest.h>

#include <algorithm>
#include <iterator>
#include <vector>

#include "dynamics/dae/kkt.hpp"

namespace espalier::dynamics {
namespace kkt_scaling_test {

// Two elastic coordinates are joined to a rigid one, which has no stiffness but rounding: all move by f / (k1 + k2).
TEST(KktScaling, RoundingOnTheDiagonalIsNoStiffness) {
  const SparsePattern w{3, 3, {0, 1, 2, 3}, {0, 1, 2}};
  const SparsePattern phi_q{2, 3, {0, 2, 4}, {0, 2, 1, 2}};
  KktSolver kkt(make_dense_solver());
  kkt.set_pattern(w, phi_q);
  kkt.set_typical({1e8, 1e8, 1e8});
  for (const double rounding : {0.0, 1e-18, -1e-18, 1e-9}) {
    const double k[] = {1e8, 3e8, rounding}, joints[] = {1, -1, 1, -1};
    std::copy(std::begin(k), std::end(k), kkt.w_values().begin());
    std::copy(std::begin(joints), std::end(joints), kkt.phi_q_values().begin());
    kkt.factorize();
    std::vector<double> x = {0, 0, 4e8, 0, 0};
    kkt.solve(x, 1);
    for (const int i : {0, 1, 2}) EXPECT_NEAR(x[static_cast<std::size_t>(i)], 1, 1e-12) << rounding;
    EXPECT_LT(kkt.scale()[2], 1e-3) << rounding;
  }
}

}  // namespace kkt_scaling_test
}  // namespace espalier::dynamics

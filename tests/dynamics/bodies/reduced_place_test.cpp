// A reduced body behind another one in the vectors of its system. Truth: maps that undo each other, differences.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "dynamics/model/built_model.hpp"
#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace reduced_place_test {

const char* const kBlockBehindAWeight = R"(
[bodies.weight]
type = "rigid"
mass = 2
box = [0.3, 0.2, 0.1]
position = [1.5, 0.2, 0.3]
[bodies.block]
type = "solid"
mesh = { part = "block", lx = 1.0, ly = 0.4, lz = 0.3, divisions = [4, 2, 1] }
material = { young = 300, poisson = 0.3, density = 7 }
reduce = { modes = 6 }
[markers]
wall = { body = "block", face = "x0" }
tip = { body = "block", face = "x1", axis = [0, 0, 1] }
[joints]
clamp = { type = "fixed", attach = "mean", a = { body = "ground" }, b = "wall" }
pin = { type = "revolute", a = "tip", b = { body = "weight" } }
[integrator]
end = 0.1
)";

TEST(ReducedPlace, BehindAnotherBodyAllIsTheSame) {
  const auto mechanism = built(kBlockBehindAWeight);
  ASSERT_EQ(mechanism->bodies.size(), 2U);
  ASSERT_NE(mechanism->bodies[1].reduced, nullptr);
  auto& system = mechanism->system;
  const State s = anywhere(*mechanism, 1, 0.1), other = anywhere(*mechanism, 2, 0.1);
  const JacobianCheck found = check_jacobians(system, s);
  EXPECT_LT(found.largest(), 2e-7) << found.worst;
  std::vector<double> step(s.v), q(s.q.size()), back(s.v.size()), rate(s.v.size()), v(s.v.size());
  for (double& x : step) x *= 0.1;
  system.retract(s.q, step, q);
  system.local(s.q, q, back);
  for (std::size_t k = 0; k < step.size(); ++k) EXPECT_NEAR(back[k], step[k], 1e-13) << k;
  system.rate_of_velocity(step, other.v, rate);
  system.velocity_of_rate(step, rate, v);
  for (std::size_t k = 0; k < v.size(); ++k) EXPECT_NEAR(v[k], other.v[k], 1e-13) << k;
  system.magnitude(s.q, v);
  for (const double x : v) EXPECT_TRUE(x > 0 && x < 10) << x;
}

}  // namespace reduced_place_test
}  // namespace espalier::dynamics

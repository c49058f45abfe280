// Runs whose steps follow a vibration say so. Truth: a beam's longitudinal and bending frequencies; a pendulum has
// none.
#include <gtest/gtest.h>

#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace held_steps_test {

bool says_vibration(const Simulation& s) {
  for (const std::string& notice : s.summary().notices)
    if (notice.find("steps follow a vibration of about") != std::string::npos) return true;
  return false;
}

const std::string kBeam = R"(gravity = [0, 0, -9.81]
[bodies.beam]
type = "beam"
start = [0, 0, 0]
end = [0.5, 0, 0]
elements = 10
height = 0.02
width = 0.004
material = { young = 2.1e11, poisson = 0.3, density = 7850 }
[joints.hinge]
type = "revolute"
a = { body = "ground", axis = [0, 1, 0] }
b = { body = "beam", node = 1, axis = [0, 1, 0] }
[integrator]
)";

TEST(HeldSteps, OfASteelBeamThatSwings) {
  const Simulation held = simulated(kBeam + "relative = 1e-6\nabsolute = 1e-8\nend = 1\nsteps = 5000\n");
  EXPECT_TRUE(says_vibration(held));
  const Simulation freed = simulated(kBeam + "max_order = 2\nabsolute_velocity = 1e-2\nend = 0.1\n");
  EXPECT_FALSE(says_vibration(freed));
  EXPECT_LT(freed.summary().steps, 300);
}

TEST(HeldSteps, APendulumIsNotHeld) { EXPECT_FALSE(says_vibration(simulated(kPendulum))); }

}  // namespace held_steps_test
}  // namespace espalier::dynamics

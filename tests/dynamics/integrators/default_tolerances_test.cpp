// Runs without a word about tolerances: places right to 1e-4 of the model's extent, at a cost near the best. Truths: a
// closed form, and runs with relative 1e-8, absolute 1e-9, order 2, velocities not tested (of 1e-7 within 2e-5).
#include <gtest/gtest.h>

#include <cmath>

#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace default_tolerances_test {

std::string beam(const std::string& end, const std::string& integrator) {
  return R"(gravity = [0, 0, -9.81]
[bodies.beam]
type = "beam"
start = [0, 0, 0]
end = )" +
         end +
         R"(
elements = 10
)" + integrator;
}

const std::string kSteelBeam = beam("[0.5, 0, 0]", R"(height = 0.02
width = 0.004
material = { young = 2.1e11, poisson = 0.3, density = 7850 }
[markers]
tip = { body = "beam", node = -1 }
[joints.hinge]
type = "revolute"
a = { body = "ground", axis = [0, 1, 0] }
b = { body = "beam", node = 1, axis = [0, 1, 0] }
[integrator]
)");

const std::string kRod = beam("[1, 0, 0]", R"(radius = 0.01
material = { young = 7e10, poisson = 0.3, density = 2700 }
[markers]
tip = { body = "beam", node = -1 }
[joints.hinge]
type = "spherical"
a = { body = "ground" }
b = { body = "beam", node = 1 }
[integrator]
)");

void expect_tip(const Simulation& s, double x, double z, double allowed) {
  EXPECT_NEAR(s.value("tip.position.x"), x, allowed);
  EXPECT_NEAR(s.value("tip.position.z"), z, allowed);
  for (const std::string& notice : s.summary().notices) ADD_FAILURE() << notice;
}

// With tolerances of 1e-8 m and m/s the first takes 78,887 steps for 4.6 ms, the second 126,634 in all.
TEST(DefaultTolerances, OfBeamsThatRing) {
  const Simulation steel = simulated(kSteelBeam + "end = 0.1\n");
  expect_tip(steel, 0.49460724, -0.07323726, 0.5e-4);
  EXPECT_LT(steel.summary().steps, 1000);
  const Simulation rod = simulated(kRod + "end = 0.5\n");
  expect_tip(rod, -0.09013856, -0.99592980, 1e-4);
  EXPECT_LT(rod.summary().steps, 1600);
}

// What is stated is obeyed: an order, and tolerances of which one is stated, as ever (1e-6, 1e-8).
TEST(DefaultTolerances, GiveWayToWhatIsStated) {
  const auto steps = [](const std::string& stated) {
    return simulated(kPendulum.substr(0, kPendulum.find("[integrator]")) + "[integrator]\nend = 1\n" + stated)
        .summary()
        .steps;
  };
  const std::string plain = "relative = 1e-6\nabsolute = 1e-8\n";
  EXPECT_EQ(steps("relative = 1e-6\n"), steps(plain));
  EXPECT_EQ(steps("absolute = 1e-8\n"), steps(plain));
  EXPECT_EQ(steps("test_velocity = true\n"), steps(plain));
  EXPECT_EQ(steps("absolute_velocity = 1e-8\n"), steps(plain));
  EXPECT_NE(steps(""), steps(plain));
  EXPECT_GT(steps("max_order = 2\n"), 2 * steps(""));
}

// The period of large swings, T = 4 K(1/2) sqrt(L / g): after four the bob is where it began, to the accuracy times the
// way; and runs that have no end of their own are judged by how the model moves.
TEST(DefaultTolerances, OfLongRuns) {
  const std::string model = kPendulum.substr(0, kPendulum.find("[integrator]"));
  const double period = 4 * std::comp_ellint_1(std::sqrt(0.5)) * std::sqrt(0.1);
  for (const double swings : {1.0, 4.0, 16.0}) {
    const Simulation s = simulated(model + "[integrator]\nend = " + std::to_string(swings * period) + "\n");
    EXPECT_NEAR(s.value("bob.position.x"), 1, 1e-4) << swings;
    EXPECT_NEAR(s.value("bob.position.y"), 0, 1e-3) << swings;
  }
  const Simulation s =
      simulated(model + "[events.down]\nwhen = \"bob.position.x < 0\"\nstop = true\n[integrator]\nend = 1e4\n");
  EXPECT_EQ(s.summary().stopped_by, "down");
  EXPECT_NEAR(s.value("bob.velocity.x"), -std::sqrt(20.0), 1e-4 * std::sqrt(20.0));
  EXPECT_LT(s.summary().steps, 300);
}

}  // namespace default_tolerances_test
}  // namespace espalier::dynamics

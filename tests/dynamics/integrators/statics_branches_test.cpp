// Systems with several equilibria at one load: the path leads to the one that grows out of the given positions, however
// long the steps are. Truth: the same path in small steps, closed forms, symmetry.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <numbers>

#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace {

constexpr double kWeak = 2e11 * 0.02 * 1e-6 / 12;  // EI of the columns
constexpr double kEuler = std::numbers::pi * std::numbers::pi * kWeak / 4;

/// A column of length 1 along z, clamped at its foot, under a weight and a push along x on its head.
std::string column(double weight, double push, const std::string& statics) {
  return fmt::format(R"([bodies.column]
type = "beam"
start = [0, 0, 0]
end = [0, 0, 1]
y = [0, 1, 0]
elements = 8
height = 0.02
width = 0.01
material = {{ young = 2e11, poisson = 0, density = 7800 }}
[joints.foot]
type = "fixed"
a = {{ body = "ground" }}
b = {{ body = "column", node = 1 }}
[markers.head]
body = "column"
node = -1
[forces.weight]
type = "load"
a = "head"
force = [{}, 0, {}]
[statics]
{}
)",
                     push, -weight, statics);
}

// Beyond Euler's load a column with an imperfection has three equilibria: bent with it, bent against it, and nearly
// straight. The path bends with it.
TEST(StaticsBranches, AnImperfectColumnBendsWithItsImperfection) {
  for (const double imperfection : {1e-2, 1e-4}) {
    const double truth =
        simulated(column(1.5 * kEuler, imperfection * kEuler, "first_step = 0.05\nlargest_step = 0.05\n"))
            .value("head.position.x");
    EXPECT_GT(truth, 0.5);
    for (const char* steps :
         {"first_step = 1\nlargest_step = 1\n", "first_step = 0.5\nlargest_step = 0.5\n", "", "tolerance = 1e-5\n"}) {
      const double side = *steps == '\0' ? -1 : 1;
      const Simulation s = simulated(column(1.5 * kEuler, side * imperfection * kEuler, steps));
      EXPECT_NEAR(side * s.value("head.position.x"), truth, 1e-4) << imperfection << ", " << steps;
    }
  }
}

// A loose tolerance counts in what the path has met, not in the reactions of a trial that is far off: one of those made
// every residual small, and the path ended with 1.6 times the energy.
TEST(StaticsBranches, AFarTrialDoesNotLoosenTheTolerance) {
  const Simulation fine = simulated(column(1.5 * kEuler, 1e-5 * kEuler, ""));
  for (const char* tolerance : {"tolerance = 1e-5\n", "tolerance = 1e-6\n", "tolerance = 1e-7\n"}) {
    const Simulation s = simulated(column(1.5 * kEuler, 1e-5 * kEuler, tolerance));
    EXPECT_NEAR(s.value("head.position.x"), fine.value("head.position.x"), 1e-4) << tolerance;
    EXPECT_LT(s.summary().statics_residual, 1) << tolerance;
  }
}

TEST(StaticsBranches, AStraightColumnStaysStraightAndSaysWhereItBuckles) {
  for (const char* steps : {"first_step = 1\nlargest_step = 1\n", "first_step = 0.5\n", ""}) {
    const Simulation s = simulated(column(1.5 * kEuler, 0, steps));
    EXPECT_NEAR(s.value("head.position.x"), 0, 1e-9) << steps;
    ASSERT_EQ(s.summary().critical.size(), 1U) << steps;
    EXPECT_NEAR(s.summary().critical[0].load, 1 / 1.5, 1e-3) << steps;
  }
}

/// A shallow arch of beams, clamped at both ends, rise 0.05 on a span of 1, with a force down on its crown.
std::string arch(double force, const std::string& statics) {
  return fmt::format(R"([bodies.arch]
type = "beam"
points = [[-0.5, 0, 0], [-0.375, 0, 0.0221], [-0.25, 0, 0.0378], [-0.125, 0, 0.0470], [0, 0, 0.05], [0.125, 0, 0.0470], [0.25, 0, 0.0378], [0.375, 0, 0.0221], [0.5, 0, 0]]
y = [0, 1, 0]
elements = 8
height = 0.02
width = 0.01
material = {{ young = 2e11, poisson = 0, density = 7800 }}
[joints.left]
type = "fixed"
a = {{ body = "ground", point = [-0.5, 0, 0] }}
b = {{ body = "arch", node = 1 }}
[joints.right]
type = "fixed"
a = {{ body = "ground", point = [0.5, 0, 0] }}
b = {{ body = "arch", node = -1 }}
[markers.crown]
body = "arch"
node = 5
[forces.push]
type = "load"
a = "crown"
force = [0, 0, {}]
[statics]
{}
)",
                     -force, statics);
}

// Between its two limit points the arch has three equilibria. Below the upper one it must not have snapped.
TEST(StaticsBranches, AShallowArchSnapsAtItsLimitPointOnly) {
  constexpr double kForce = 6e4;
  const char* small = "first_step = 0.05\nlargest_step = 0.05\n";
  const Simulation reference = simulated(arch(kForce, small));
  ASSERT_GE(reference.summary().critical.size(), 2U);
  const double limit = kForce * reference.summary().critical.front().load;
  EXPECT_TRUE(reference.summary().critical.front().limit);
  for (const char* steps : {"first_step = 1\nlargest_step = 1\n", "first_step = 0.5\nlargest_step = 0.5\n", ""}) {
    for (const double part : {0.5, 0.99}) {
      const Simulation s = simulated(arch(part * limit, steps));
      EXPECT_TRUE(s.summary().critical.empty()) << part << ", " << steps;
      EXPECT_NEAR(s.value("crown.position.z"), simulated(arch(part * limit, small)).value("crown.position.z"), 1e-7)
          << part << ", " << steps;
    }
    const Simulation s = simulated(arch(kForce, steps));
    EXPECT_NEAR(s.value("crown.position.z"), reference.value("crown.position.z"), 1e-7) << steps;
    ASSERT_EQ(s.summary().critical.size(), reference.summary().critical.size()) << steps;
    EXPECT_NEAR(s.summary().critical.front().load * kForce / limit, 1, 1e-5) << steps;
  }
}

}  // namespace
}  // namespace espalier::dynamics

// Static equilibrium as a run of its own. Truths: closed forms, named at each test.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace {

/// What went wrong with a model that must not load and run.
Status failed(const std::string& text) {
  Simulation simulation;
  Status status = simulation.load_text(text, "model.toml");
  if (status.ok()) status = simulation.run();
  EXPECT_FALSE(status.ok());
  return status;
}

// ---- Limit points: a truss of two springs, half span b = 1, height h, spring constant k = 1000

std::string truss(double height, double force, const std::string& statics = "") {
  return fmt::format(R"([bodies.apex]
type = "rigid"
mass = 1
box = [0.1, 0.1, 0.1]
position = [0, 0, {0}]
[joints.rail]
type = "prismatic"
bodies = ["ground", "apex"]
at = [0, 0, {0}]
axis = [0, 0, 1]
[forces.left]
type = "spring"
a = {{ body = "ground", point = [-1, 0, 0] }}
b = {{ body = "apex" }}
stiffness = 1000
[forces.right]
type = "spring"
a = {{ body = "ground", point = [1, 0, 0] }}
b = {{ body = "apex" }}
stiffness = 1000
[forces.weight]
type = "load"
a = {{ body = "apex" }}
force = [0, 0, {1}]
[statics]
{2}
)",
                     height, -force, statics);
}

/// Force down that holds the apex at z: 2 k z (1 - L0 / L).
double truss_force(double height, double z) { return -2000 * z * (1 - std::hypot(1, height) / std::hypot(1, z)); }

/// dP/dz = 0 at L^3 = L0 b^2 (von Mises 1923).
double truss_limit(double height) {
  const double length = std::cbrt(std::hypot(1, height));
  return truss_force(height, std::sqrt(length * length - 1));
}

// What the summary says is out of balance: the force without what the springs bear at the place that was found.
TEST(Statics, ResidualIsWhatIsOutOfBalance) {
  const double height = 0.3, force = 2, scale = 1000 * height;
  const Simulation s = simulated(truss(height, force, "tolerance = 1e-2"));
  const double left = std::abs(force - truss_force(height, s.value("apex.position.z")));
  EXPECT_GT(left, 1e-12 * scale) << "a loose tolerance leaves something";
  EXPECT_NEAR(s.summary().statics_residual, left, 1e-13 * scale);
}

TEST(StaticsLimit, TrussSnapsThroughAtItsClosedForm) {
  for (const double height : {0.05, 0.2, 0.6, 1.0}) {
    const double limit = truss_limit(height), force = 1.5 * limit;
    const Simulation s = simulated(truss(height, force));
    ASSERT_EQ(s.summary().critical.size(), 2U) << height;  // up to the limit, back to its opposite, and up again
    EXPECT_TRUE(s.summary().critical[0].limit);
    EXPECT_NEAR(s.summary().critical[0].load, limit / force, 1e-9) << height;
    EXPECT_NEAR(s.summary().critical[1].load, -limit / force, 1e-9) << height;
    const double z = s.value("apex.position.z");
    EXPECT_LT(z, -height);
    EXPECT_NEAR(truss_force(height, z) / force, 1, 1e-8) << height;
  }
}

TEST(StaticsLimit, StepsAndArcsOfAnySizeFindTheSamePoints) {
  const double height = 0.4, limit = truss_limit(height);
  for (const char* statics : {"first_step = 1", "first_step = 0.01", "largest_step = 0.02\nfirst_step = 0.02",
                              "tolerance = 1e-6", "tolerance = 1e-12", "largest_step = 1\nfirst_step = 0.5"}) {
    const Simulation s = simulated(truss(height, 2 * limit, statics));
    ASSERT_EQ(s.summary().critical.size(), 2U) << statics;
    EXPECT_NEAR(s.summary().critical[0].load, 0.5, 1e-5) << statics;
    EXPECT_NEAR(truss_force(height, s.value("apex.position.z")) / limit, 2, 1e-5) << statics;
  }
}

TEST(StaticsLimit, BelowTheLimitNothingIsReported) {
  const double height = 0.4, limit = truss_limit(height);
  const Simulation s = simulated(truss(height, 0.999 * limit));
  EXPECT_TRUE(s.summary().critical.empty());
  EXPECT_GT(s.value("apex.position.z"), 0);
  EXPECT_NEAR(truss_force(height, s.value("apex.position.z")) / limit, 0.999, 1e-9);
}

TEST(StaticsLimit, LoadStepsAloneEndThereAndSayWhere) {
  const double height = 0.4, limit = truss_limit(height);
  const Status status = failed(truss(height, 2 * limit, "path = \"load-steps\""));
  EXPECT_EQ(status.code, StatusCode::accuracy_not_reached);
  EXPECT_NE(status.message.find("load factor 0.49"), std::string::npos) << status.message;
  EXPECT_NE(status.message.find("apex"), std::string::npos) << status.message;
}

// Newton is given too few iterations for any step: the relaxation, which counts its own, does without a path.
TEST(StaticsLimit, WhereNoStepIsPossibleTheRelaxationFindsThePlace) {
  const double height = 0.4, force = 0.5 * truss_limit(height);
  const Simulation s = simulated(truss(height, force, "max_iterations = 1\nfirst_step = 0.1\nsmallest_step = 0.1"));
  EXPECT_TRUE(s.summary().statics_relaxed);
  EXPECT_NEAR(truss_force(height, s.value("apex.position.z")) / force, 1, 1e-7);
  EXPECT_GT(s.value("apex.position.z"), 0);
  const Status status =
      failed(truss(height, force, "max_iterations = 1\nfirst_step = 0.1\nsmallest_step = 0.1\npath = \"load-steps\""));
  EXPECT_NE(status.message.find("too many iterations"), std::string::npos) << status.message;
}

TEST(StaticsLimit, ALoadFactorBeyondOneIsTheSameAsALargerLoad) {
  const double height = 0.4, limit = truss_limit(height);
  const Simulation s = simulated(truss(height, limit, "load = 2"));
  ASSERT_EQ(s.summary().critical.size(), 2U);
  EXPECT_NEAR(s.summary().critical[0].load, 1, 1e-8);
  EXPECT_EQ(s.time(), 2);
}

// ---- Beams that are clamped where they begin and loaded at their tip

std::string clamped_beam(int elements, const std::string& shape, const std::string& load,
                         const std::string& statics = "") {
  return fmt::format(R"([bodies.beam]
type = "beam"
start = [0, 0, 0]
elements = {}
{}
[joints.wall]
type = "fixed"
a = {{ body = "ground" }}
b = {{ body = "beam", node = 1 }}
[markers.tip]
body = "beam"
node = -1
[forces.load]
type = "load"
a = "tip"
{}
[statics]
{}
)",
                     elements, shape, load, statics);
}

// ---- Bifurcation: a column of length 1, clamped at its foot

std::string column(int elements, double force) {
  return clamped_beam(elements, R"(end = [0, 0, 1]
y = [0, 1, 0]
height = 0.02
width = 0.01
material = { young = 2e11, poisson = 0, density = 7800 })",
                      fmt::format("force = [0, 0, {}]", -force));
}

// Truth: Euler, pi^2 EI / (4 L^2) about the weak axis; the compression P / EA and the shear are below 1e-3 of it.
TEST(StaticsBifurcation, StraightColumnBucklesAtEulersLoad) {
  const double weak = 2e11 * 0.02 * 1e-6 / 12;
  const double euler = std::numbers::pi * std::numbers::pi * weak / 4;
  double error[2];
  for (const int elements : {8, 16}) {
    const Simulation s = simulated(column(elements, 2 * euler));
    ASSERT_EQ(s.summary().critical.size(), 1U) << elements;
    EXPECT_FALSE(s.summary().critical[0].limit);
    error[elements == 16] = s.summary().critical[0].load / 0.5 - 1;
    EXPECT_NEAR(error[elements == 16], 0, 1e-3) << elements;
  }
  // The elements converge with order 4: what is left with eight is the compression, which both have.
  EXPECT_NEAR(error[0], error[1], 1e-4);
}

// ---- Large turns

// Truth: M L / EI = 2 pi bends a straight beam to a circle: its tip is where it began.
TEST(StaticsTurns, MomentRollsABeamUpToACircle) {
  const double length = 2, ei = 2.1e11 * 0.02 * 1e-6 / 12;
  for (const int elements : {8, 16}) {
    const Simulation s =
        simulated(clamped_beam(elements, R"(end = [2, 0, 0]
y = [0, 1, 0]
height = 0.01
width = 0.02
material = { young = 2.1e11, poisson = 0, density = 7800 })",
                               fmt::format("moment = [0, 0, {}]", 2 * std::numbers::pi * ei / length)));
    const double off = std::hypot(s.value("tip.position.x"), s.value("tip.position.y"));
    EXPECT_LT(off / length, 10.0 / (elements * elements)) << elements;
    EXPECT_LE(s.summary().steps, 60) << elements;
    EXPECT_TRUE(s.summary().critical.empty());
  }
}

// The same, in at most 20 steps.
TEST(StaticsTurns, RollUpToAFullCircleInTwentySteps) {
  for (const int elements : {2, 3, 4, 8, 32, 128, 512}) {
    const Simulation s = simulated(clamped_beam(elements, R"(end = [2, 0, 0]
height = 0.02
width = 0.02
material = { young = 2.1e11, poisson = 0.3, density = 7850 })",
                                                "moment = [0, 0, \"2*pi*2.1e11*0.02^4/12/2\"]"));
    EXPECT_LE(s.summary().statics_steps, 20) << elements;
    EXPECT_LT(s.value("tip.position.norm"), 1e-7 * 2) << elements;
  }
}

// ---- Inverted elements

/// So wide that it does not buckle; `stress` per undeformed area of 100.
std::string bar(double stress, const std::string& rest = "[statics]\n") {
  return fmt::format(R"([bodies.bar]
type = "solid"
mesh = {{ part = "block", lx = 1, ly = 10, lz = 10, divisions = [2, 2, 2] }}
hex8 = "full"
material = {{ law = "neo-hookean", young = 1e6, poisson = 0, density = 1000 }}
[joints.wall]
type = "fixed"
a = {{ body = "ground", point = [0, 5, 5] }}
b = {{ body = "bar", face = "x0" }}
[markers.end]
body = "bar"
face = "x1"
[forces.pull]
type = "load"
a = "end"
force = [{}, 0, 0]
{})",
                     100 * stress, rest);
}

// Truth: W = mu/2 (tr C - 3) - mu ln J at poisson 0: P = E/2 (s - 1/s). The first Newton step for P = -4 E leads to a
// stretch of -3, inside out.
TEST(StaticsInverted, BlockUnderFourTimesItsModulusIsCompressedNotInverted) {
  for (const double p : {-4.0, -0.9, 3.0}) {
    const Simulation s = simulated(bar(1e6 * p));
    EXPECT_NEAR(s.value("end.position.x"), p + std::sqrt(p * p + 1), 1e-7) << p;
  }
}

// Truth: St. Venant-Kirchhoff, P = E/2 (s^3 - s), falls back at s = 1/sqrt(3): no more than E / (3 sqrt 3) holds it.
TEST(StaticsInverted, SoftMaterialReachesItsLimitPoint) {
  std::string text = bar(-1e6);
  text.replace(text.find("neo-hookean"), 11, "st-venant-kirchhoff");
  Simulation s;
  ASSERT_TRUE(s.load_text(text, "model.toml").ok());
  const Status status = s.run();
  EXPECT_EQ(status.code, StatusCode::accuracy_not_reached);
  EXPECT_NE(status.message.find("limit point at load factor 0.19245"), std::string::npos) << status.message;
}

// ---- Loose ends

TEST(StaticsLoose, AFreeBodyFallsAndIsNamed) {
  std::string text = "gravity = [0, 0, -10]\n" + bar(0);
  const std::size_t joint = text.find("[joints.wall]"), end = text.find("[markers.end]");
  text.erase(joint, end - joint);
  const Status status = failed(text);
  EXPECT_EQ(status.code, StatusCode::accuracy_not_reached);
  EXPECT_NE(status.message.find("nothing holds"), std::string::npos) << status.message;
  EXPECT_NE(status.message.find("'bar'"), std::string::npos) << status.message;
}

TEST(StaticsLoose, NoLoadsNoSteps) {
  const Simulation s = simulated(bar(0));
  EXPECT_EQ(s.summary().statics_iterations, 0);
  EXPECT_EQ(s.value("end.position.x"), 1);
}

TEST(StaticsLoose, AMechanismFindsItsPlace) {
  const Simulation s = simulated(R"(gravity = [0, 0, -10]
[bodies.rod]
type = "rigid"
mass = 1
box = [1, 0.1, 0.1]
position = [0.5, 0, 0]
[joints.hinge]
type = "revolute"
bodies = ["ground", "rod"]
at = [0, 0, 0]
axis = [0, 1, 0]
[statics]
)");
  EXPECT_TRUE(s.summary().statics_relaxed);
  EXPECT_NEAR(s.value("rod.position.z"), -0.5, 1e-9);
  EXPECT_NEAR(s.value("hinge.force.z"), 10, 1e-8);
}

// An axle in two springs, which leave its turn free, with a small weight at its side. Only rounding holds the turn
// without loads, and a path that follows rounding creeps.
TEST(StaticsLoose, AnAxleTurnsItsHeavySideDown) {
  const Simulation s = simulated(R"(gravity = [0, 0, -9.81]
[bodies.axle]
type = "solid"
mesh = { part = "block", lx = 1, ly = 0.1, lz = 0.1, divisions = [8, 2, 2] }
material = { young = 2e11, poisson = 0.3, density = 7800 }
[bodies.bob]
type = "rigid"
mass = 0.1
box = [0.01, 0.01, 0.01]
position = [0.5, 0.2, 0.05]
[joints.weld]
type = "fixed"
a = { body = "axle", face = "y1" }
b = { body = "bob", point = [0, -0.1, 0] }
[forces.left]
type = "bushing"
a = { body = "ground", point = [0, 0.05, 0.05] }
b = { body = "axle", face = "x0" }
stiffness = [1e7, 1e7, 1e7]
[forces.right]
type = "bushing"
a = { body = "ground", point = [1, 0.05, 0.05] }
b = { body = "axle", face = "x1" }
stiffness = [1e7, 1e7, 1e7]
[statics]
)");
  EXPECT_TRUE(s.summary().statics_relaxed);
  EXPECT_LT(s.summary().factorizations, 400);
  EXPECT_NEAR(s.value("bob.position.y"), 0.05, 1e-4);
  EXPECT_NEAR(s.value("bob.position.z"), -0.1, 2e-4);  // and the springs give a little
}

// What overflows, or is beyond all rounding, balances nothing.
TEST(StaticsLoose, MonstrousLoadsHaveNoEquilibrium) {
  for (const char* gravity : {"-1e12", "-1e200", "-1e308"}) {
    const Status status = failed(fmt::format("gravity = [0, 0, {}]\n", gravity) + bar(0));
    EXPECT_EQ(status.code, StatusCode::accuracy_not_reached) << gravity << ": " << status.message;
    EXPECT_EQ(status.message.find("nan"), std::string::npos) << status.message;
  }
}

TEST(StaticsLoose, ACoarseToleranceIsRefused) {
  EXPECT_EQ(failed(bar(-1e5) + "tolerance = 0.2\n").code, StatusCode::invalid_input);
}

TEST(StaticsLoose, TheLastStepIsNamed) {
  const std::string message = failed(bar(-1e5) + "max_steps = 1\n").message;
  EXPECT_NE(message.find("max_steps allows no more"), std::string::npos) << message;
  EXPECT_EQ(message.find("furthest out of balance ;"), std::string::npos) << message;
}

// ---- Work that takes long is seen, can be stopped, and has a limit

TEST(StaticsWork, IsLimited) {
  const Status status = failed(bar(-1e6) + "max_factorizations = 3\n");
  EXPECT_EQ(status.code, StatusCode::accuracy_not_reached);
  EXPECT_NE(status.message.find("after 3 factorizations"), std::string::npos) << status.message;
  EXPECT_NE(status.message.find("max_factorizations allows no more"), std::string::npos) << status.message;
}

TEST(StaticsWork, IsSeenAndStopped) {
  const std::string text = bar(-1e6);
  int seen = 0, most = 1000;
  SimulationOptions options;
  options.on_search = [&](const SimulationSearch& search) {
    EXPECT_EQ(search.factorizations, seen);
    return ++seen < most;
  };
  EXPECT_EQ(simulated(text, options).summary().factorizations, seen);

  seen = 0, most = 4;
  const Simulation stopped = simulated(text, options);
  EXPECT_TRUE(stopped.summary().interrupted);
  EXPECT_EQ(stopped.summary().factorizations, most - 1);
  EXPECT_LT(stopped.time(), 1);

  seen = 0;
  std::string motion = text;
  motion.replace(motion.find("[statics]"), 9, "[integrator]\nend = 1\n[initial]\nstatics = true\n");
  Simulation s(options);
  EXPECT_EQ(s.load_text(motion, "model.toml").code, StatusCode::cancelled);
}

// ---- What the given configuration has out of balance comes in with the load

TEST(StaticsMisfit, MotorsAndJointsPullAFaceStepByStep) {
  // The end face is pulled by half of the length at once: one step of Newton from the start would invert elements.
  std::string text = bar(0);
  text += R"([joints.motor]
type = "translation-motor"
a = { body = "ground", point = [1, 5, 5], axis = [1, 0, 0] }
b = "end"
motion = "-0.7"
)";
  const Simulation s = simulated(text);
  EXPECT_NEAR(s.value("end.position.x"), 0.3, 1e-9);
  // Uniform: P = E/2 (s - 1/s); the motor's force on the bar.
  EXPECT_NEAR(s.value("motor.force.x"), 0.5e8 * (0.3 - 1 / 0.3), 1);
}

TEST(StaticsMisfit, PrestressedSpringsFindTheirBalance) {
  // Truth: k1 (x - l1) = k2 (l2 - x) for two springs in line.
  const Simulation s = simulated(R"([bodies.bead]
type = "rigid"
mass = 1
box = [0.1, 0.1, 0.1]
[joints.rail]
type = "prismatic"
bodies = ["ground", "bead"]
at = [0, 0, 0]
axis = [1, 0, 0]
[forces.left]
type = "axial-spring"
a = { body = "ground", point = [-1, 0, 0], axis = [1, 0, 0] }
b = { body = "bead" }
stiffness = 100
rest = 0.2
[forces.right]
type = "axial-spring"
a = { body = "bead", axis = [1, 0, 0] }
b = { body = "ground", point = [1, 0, 0] }
stiffness = 300
rest = 0.5
[statics]
)");
  EXPECT_NEAR(s.value("bead.position.x"), (300 * 0.5 - 100 * 0.8) / 400, 1e-12);
}

}  // namespace
}  // namespace espalier::dynamics

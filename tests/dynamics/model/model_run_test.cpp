// Whole runs through the text. Truth: closed forms, conservation, and a run without a break.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "dynamics/elements/material.hpp"
#include "dynamics/model/model_common.hpp"
#include "dynamics/model/output/pictures.hpp"

namespace espalier::dynamics {
namespace {

/// Complete elliptic integral K(k) by the arithmetic-geometric mean.
double elliptic_k(double k) {
  double a = 1, b = std::sqrt(1 - k * k);
  for (int i = 0; i < 40; ++i) {
    const double mean = 0.5 * (a + b);
    b = std::sqrt(a * b);
    a = mean;
  }
  return std::numbers::pi / (2 * a);
}

TEST(ModelRun, PendulumComesBackAfterItsPeriod) {
  // From the horizontal: T = 4 sqrt(l/g) K(sin 45 deg). The bob's inertia adds 5e-10 to l.
  const double period = 4 * std::sqrt(1.0 / 10) * elliptic_k(std::sqrt(0.5));
  SimulationOptions options;
  options.until = period;
  const Simulation s = simulated(kPendulum, options);
  EXPECT_EQ(s.time(), period);
  // Error per step 1e-10, some hundred steps.
  EXPECT_NEAR(s.value("bob.position.x"), 1, 1e-7);
  EXPECT_NEAR(s.value("bob.position.y"), 0, 1e-6);
  EXPECT_LT(s.summary().largest_violation.position, 1e-10);
  EXPECT_NEAR(s.summary().energy_end.kinetic + s.summary().energy_end.potential, 0, 1e-6);
  EXPECT_EQ(s.summary().degrees_of_freedom, 1);
}

TEST(ModelRun, PendulumPullsThreeTimesItsWeightAtTheBottom) {
  SimulationOptions options;
  options.until = std::sqrt(1.0 / 10) * elliptic_k(std::sqrt(0.5));
  const Simulation s = simulated(kPendulum, options);
  EXPECT_NEAR(s.value("hinge.force.y"), 3 * 2 * 10, 1e-5);  // of the hinge on the bob
  EXPECT_NEAR(s.value("bob.velocity.norm"), std::sqrt(2 * 10.0), 1e-7);
  EXPECT_NEAR(s.value("bob.acceleration.y"), 20, 1e-5);
}

const std::string kSliderCrank = R"([parameters]
r = 0.06
l = 0.15
[bodies.crank]
type = "rigid"
mass = 1
inertia = [1e-3, 1e-3, 1e-3]
[bodies.rod]
type = "rigid"
mass = 0.5
inertia = [1e-4, 1e-3, 1e-3]
position = ["r + l/2", 0, 0]
[bodies.slider]
type = "rigid"
mass = 0.3
box = [0.02, 0.02, 0.02]
position = ["r + l", 0, 0]
[joints]
bearing = { type = "revolute", bodies = ["ground", "crank"], at = [0, 0, 0], axis = [0, 0, 1] }
pin = { type = "revolute", bodies = ["crank", "rod"], at = ["r", 0, 0], axis = [0, 0, 1] }
wrist = { type = "revolute", bodies = ["rod", "slider"], at = ["r + l", 0, 0], axis = [0, 0, 1] }
guide = { type = "prismatic", a = { body = "ground", axis = [1, 0, 0] }, b = { body = "slider", axis = [1, 0, 0] } }
motor = { type = "rotation-motor", bodies = ["ground", "crank"], at = [0, 0, 0], axis = [0, 0, 1], motion = "20*t + sin(30*t)/3" }
[integrator]
relative = 1e-9
absolute = 1e-10
end = 0.3
)";

TEST(ModelRun, SliderCrankFollowsItsClosedForm) {
  const Simulation s = simulated(kSliderCrank);
  const double t = 0.3, r = 0.06, l = 0.15, angle = 20 * t + std::sin(30 * t) / 3, rate = 20 + 10 * std::cos(30 * t);
  const double root = std::sqrt(l * l - r * r * std::sin(angle) * std::sin(angle));
  const double slope = -r * std::sin(angle) - r * r * std::sin(angle) * std::cos(angle) / root;
  // Fully driven: position and velocity follow from the constraints, which hold to 1e-10.
  EXPECT_NEAR(s.value("slider.position.x"), r * std::cos(angle) + root, 1e-9);
  EXPECT_NEAR(s.value("slider.velocity.x"), slope * rate, 1e-7);
  // A plane mechanism of spatial joints: three loops too many equations, named and left out.
  EXPECT_EQ(s.summary().degrees_of_freedom, 0);
  EXPECT_EQ(s.summary().redundant.size(), 3U);
  EXPECT_NE(s.summary().redundant.front().find("redundant"), std::string::npos);
}

TEST(ModelRun, StaticsFindsTheStretchedSpring) {
  const Simulation s = simulated(R"(gravity = [0, 0, -9.81]
[bodies.mass]
type = "rigid"
mass = 3
box = [0.1, 0.1, 0.1]
position = [0, 0, -1]
[joints.rail]
type = "prismatic"
bodies = ["ground", "mass"]
at = [0, 0, -1]
axis = [0, 0, 1]
[forces.spring]
type = "spring"
a = { body = "ground" }
b = { body = "mass" }
stiffness = 1000
rest = 1
[integrator]
method = "generalized-alpha"
step = 1e-3
end = 0.01
[initial]
statics = true
modes = 1
)");
  EXPECT_NEAR(s.value("mass.position.z"), -1 - 3 * 9.81 / 1000, 1e-9);
  ASSERT_EQ(s.summary().modes.size(), 1U);
  EXPECT_NEAR(s.summary().modes[0].frequency, std::sqrt(1000.0 / 3) / (2 * std::numbers::pi), 1e-6);
}

/// Steps to the end from the start, and from the restart file that the same kind of run left on its way.
void expect_same_after_restart(const std::string& model, const std::string& quantity) {
  const ScratchFolder whole, broken;
  SimulationOptions options;
  options.out = whole.path();
  const std::string text = model + "[output]\nrestart_interval = 0.1\nquantities = [\"" + quantity + "\"]\n";
  const Simulation uninterrupted = simulated(text, options);
  // Stopped by the observer right after the restart file of t >= 0.2 was written.
  options.out = broken.path();
  Simulation first(options);
  ASSERT_TRUE(first.load_text(text, "model.toml").ok());
  ASSERT_TRUE(first.run([](const SimulationStep& step) { return step.t < 0.2; }).ok());
  EXPECT_TRUE(first.summary().interrupted);
  ASSERT_LT(first.time(), 0.3);
  options.restart = broken.path() + "/state.restart";
  const Simulation second = simulated(text, options);
  EXPECT_EQ(second.summary().t_begin, first.time());
  EXPECT_EQ(second.summary().steps, uninterrupted.summary().steps);
  EXPECT_EQ(second.value(quantity), uninterrupted.value(quantity));  // to the last bit
  EXPECT_EQ(content_of(broken.path() + "/quantities.csv"), content_of(whole.path() + "/quantities.csv"));
}

TEST(ModelRestart, TheRestContinuesToTheSameBits) { expect_same_after_restart(kPendulum, "bob.position.x"); }

// The shapes are made anew, and have to be the same to the last bit.
TEST(ModelRestart, OfReducedBodiesContinuesToTheSameBits) {
  const std::string text = R"(
gravity = [0, -9.81, 0]
[bodies.arm]
type = "solid"
mesh = { part = "block", lx = 1.0, ly = 0.1, lz = 0.1, divisions = [8, 2, 2] }
material = { young = 1e8, poisson = 0.3, density = 1000 }
reduce = { modes = 6 }
[joints.hinge]
type = "revolute"
a = { body = "ground", axis = [0, 0, 1] }
b = { body = "arm", face = "x0" }
[integrator]
end = 0.5
)";
  expect_same_after_restart(text, "arm.position.y");
}

TEST(ModelRestart, AlsoWithGeneralizedAlphaAndTurnsThatGearsCount) {
  const std::string text = R"(gravity = [0, -10, 0]
[bodies.a]
type = "rigid"
mass = 1
box = [0.1, 0.1, 0.1]
[bodies.b]
type = "rigid"
mass = 1
box = [0.2, 0.2, 0.2]
position = [1, 0, 0]
[bodies.weight]
type = "rigid"
mass = 0.1
box = [0.1, 0.1, 0.1]
position = [1.3, 0, 0]
[joints]
ha = { type = "revolute", bodies = ["ground", "a"], at = [0, 0, 0], axis = [0, 0, 1] }
hb = { type = "revolute", bodies = ["ground", "b"], at = [1, 0, 0], axis = [0, 0, 1] }
gear = { type = "gear", a = { body = "ground", axis = [0, 0, 1] }, b = { body = "a" }, c = { body = "ground", axis = [0, 0, 1] }, d = { body = "b" }, ratio = 0.1 }
arm = { type = "fixed", bodies = ["b", "weight"], at = [1.3, 0, 0] }
[integrator]
method = "generalized-alpha"
step = 0.004
end = 0.5
)";
  expect_same_after_restart(text, "a.angular_velocity.z");
}

TEST(ModelRestart, RefusesFilesOfOtherModels) {
  const ScratchFolder folder;
  SimulationOptions options;
  options.out = folder.path();
  static_cast<void>(simulated(kPendulum, options));
  options.restart = folder.path() + "/state.restart";
  const auto message = [&](const std::string& text) {
    Simulation s(options);
    const Status status = s.load_text(text, "model.toml");
    EXPECT_EQ(status.code, StatusCode::invalid_input);
    return status.message;
  };
  EXPECT_NE(message(kSliderCrank).find("another model"), std::string::npos);
  options.until = 0.5;
  EXPECT_NE(message(kPendulum).find("later --until"), std::string::npos);
  std::filesystem::resize_file(options.restart, 100);
  options.until = 2;
  EXPECT_NE(message(kPendulum).find("ends too early"), std::string::npos);
  std::ofstream(options.restart) << "nonsense nonsense nonsense";
  EXPECT_NE(message(kPendulum).find("not a restart file"), std::string::npos);
}

TEST(ModelPictures, VonMisesOfSimpleStates) {
  Material m;
  m.young = 200;
  m.poisson = 0.3;
  m.density = 1;
  const std::vector<double> reference = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 1, 1, 0, 1, 1, 1, 1, 0, 1, 1};
  const auto deformed = [&](double x, double y, double z) {
    std::vector<double> p = reference;
    for (std::size_t i = 0; i < p.size(); i += 3) p[i] *= x, p[i + 1] *= y, p[i + 2] *= z;
    return model::von_mises(ElementType::hex8, m, reference, p);
  };
  const double e = 1e-6;
  EXPECT_NEAR(deformed(1 + e, 1 - 0.3 * e, 1 - 0.3 * e), 200 * e, 2e-9);  // uniaxial: E eps, to O(eps^2)
  EXPECT_NEAR(deformed(1 + e, 1 + e, 1 + e), 0, 1e-12);                   // hydrostatic
  m.law = SolidLaw::neo_hookean;
  EXPECT_NEAR(deformed(1 + e, 1 - 0.3 * e, 1 - 0.3 * e), 200 * e, 2e-9);
}

}  // namespace
}  // namespace espalier::dynamics

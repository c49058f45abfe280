// Motions with contact between rigid bodies. Truth: closed forms.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace contact_motion_test {

constexpr double kGravity = 9.81;

std::string ball(const std::string& name, double radius, double mass, const std::string& more) {
  const double inertia = 0.4 * mass * radius * radius;
  return fmt::format(
      "[bodies.{0}]\ntype = \"rigid\"\nmass = {1}\ninertia = [{2:.17g}, {2:.17g}, {2:.17g}]\n{3}\n"
      "[surfaces.{0}]\nbody = \"{0}\"\nshape = \"sphere\"\nradius = {4}\n",
      name, mass, inertia, more, radius);
}

const std::string kFloor = "[surfaces.floor]\nbody = \"ground\"\nshape = \"plane\"\n";

std::string integrator(double end, double tolerance) {
  return fmt::format("[integrator]\nend = {:.17g}\nrelative = {:g}\nabsolute = {:g}\n", end, tolerance, tolerance);
}

// Free fall and half a period of an oscillator by turns: v0 = sqrt(2 g h), omega^2 = k / m, and the ball is on the
// floor for 2 (pi - atan(v0 omega / g)) / omega.
TEST(ContactMotion, BouncingBall) {
  constexpr double kHeight = 0.5, kMass = 2, kStiffness = 1e5, kRadius = 0.1;
  const double v0 = std::sqrt(2 * kGravity * kHeight), omega = std::sqrt(kStiffness / kMass);
  const double contact = 2 * (std::numbers::pi - std::atan(v0 * omega / kGravity)) / omega;
  const double period = 2 * v0 / kGravity + contact;
  const std::string text =
      "gravity = [0, 0, -9.81]\n" +
      ball("ball", kRadius, kMass, fmt::format("position = [0, 0, {}]", kRadius + kHeight)) + kFloor +
      fmt::format("[contacts.bounce]\nsurfaces = [\"floor\", \"ball\"]\nstiffness = {}\n", kStiffness) +
      integrator(10 * period, 1e-11) +
      fmt::format("[events.impact]\nwhen = \"{} - ball.position.z >= 0\"\ntolerance = 1e-10\n", kRadius);
  Simulation simulation;
  ASSERT_TRUE(simulation.load_text(text, "ball.toml").ok());
  for (int k = 1; k <= 10; ++k) {
    const Status status = simulation.step_to(k * period);
    ASSERT_TRUE(status.ok()) << status.message;
    EXPECT_NEAR(simulation.value("ball.position.z"), kRadius + kHeight, 1e-6 * kHeight) << "apex " << k;
    EXPECT_NEAR(simulation.value("ball.velocity.z"), 0, 1e-6 * v0) << "apex " << k;
  }
  const auto& events = simulation.summary().events;
  ASSERT_EQ(events.size(), 10U);
  for (std::size_t k = 0; k < 10; ++k)
    EXPECT_NEAR(events[k].t, v0 / kGravity + static_cast<double>(k) * period, 1e-6 * period) << "impact " << k;
}

TEST(ContactMotion, RestitutionIsMetAtAnySpeed) {
  for (const double speed : {0.1, 1.0, 7.0})
    for (const double exponent : {1.0, 1.5}) {
      const std::string text =
          ball("ball", 0.1, 2, fmt::format("position = [0, 0, 0.101]\nvelocity = [0, 0, {}]", -speed)) + kFloor +
          fmt::format(
              "[contacts.bounce]\nsurfaces = [\"floor\", \"ball\"]\nstiffness = 1e5\nexponent = {}\nrestitution "
              "= 0.6\n",
              exponent) +
          integrator(0.2 / speed + 0.1, 1e-9);
      EXPECT_NEAR(simulated(text).value("ball.velocity.z"), 0.6 * speed, 1e-5 * speed) << speed << ", " << exponent;
    }
}

/// A block on a slope, at rest on it.
std::string block_on_slope(double angle, double friction, double end) {
  constexpr double kMass = 2, kStiffness = 2e6;  // 4 corners of the lower face
  const double sink = kMass * kGravity * std::cos(angle) / (4 * kStiffness);
  return fmt::format(
      "gravity = [{:.17g}, 0, {:.17g}]\n[bodies.block]\ntype = \"rigid\"\nmass = {}\nbox = [0.4, 0.3, 0.1]\nposition = "
      "[0, 0, {:.17g}]\n[surfaces.block]\nbody = \"block\"\nshape = \"box\"\nsize = [0.4, 0.3, 0.1]\n{}"
      "[contacts.slope]\nsurfaces = [\"floor\", \"block\"]\nstiffness = {}\nfriction = {}\ntangential_damping = "
      "1e3\ndamping = 50\n{}",
      kGravity * std::sin(angle), -kGravity * std::cos(angle), kMass, 0.05 - sink, kFloor, kStiffness, friction,
      integrator(end, 1e-8));
}

// Coulomb: it sticks up to tan(angle) = mu and slides with g (sin - mu cos) beyond.
TEST(ContactMotion, BlockOnSlope) {
  constexpr double kFriction = 0.4;
  const double limit = std::atan(kFriction);
  const Simulation sticks = simulated(block_on_slope(limit - 1e-3, kFriction, 1));
  EXPECT_LT(sticks.value("block.position.x"), 2e-4);  // it swings into the springs that hold it
  EXPECT_LT(std::abs(sticks.value("block.velocity.x")), 1e-6);
  EXPECT_EQ(sticks.value("slope.slipping"), 0);
  const double angle = limit + 1e-3, a = kGravity * (std::sin(angle) - kFriction * std::cos(angle));
  Simulation slides;
  ASSERT_TRUE(slides.load_text(block_on_slope(angle, kFriction, 1), "slope.toml").ok());
  ASSERT_TRUE(slides.step_to(0.5).ok());
  const double before = slides.value("block.velocity.x");
  ASSERT_TRUE(slides.step_to(1).ok());
  EXPECT_EQ(slides.value("slope.slipping"), 4);
  EXPECT_NEAR(slides.value("block.velocity.x") - before, 0.5 * a, 0.01 * a);
  const double steep = 0.7, fast = kGravity * (std::sin(steep) - kFriction * std::cos(steep));
  EXPECT_NEAR(simulated(block_on_slope(steep, kFriction, 1)).value("block.velocity.x"), fast, 1e-3 * fast);
}

// Equal masses that meet one after the other: the last one leaves with all of it.
TEST(ContactMotion, NewtonsCradle) {
  std::string text;
  for (int k = 0; k < 5; ++k)
    text += ball(fmt::format("ball{}", k), 0.05, 1,
                 fmt::format("position = [{}, 0, 0]\nvelocity = [{}, 0, 0]", 0.101 * k, k == 0 ? 1 : 0));
  text += "[contacts.cradle]\nsurfaces = [\"ball*\"]\nstiffness = 1e8\n" + integrator(0.02, 1e-10);
  const Simulation simulation = simulated(text);
  for (int k = 0; k < 5; ++k)
    EXPECT_NEAR(simulation.value(fmt::format("ball{}.velocity.x", k)), k == 4 ? 1 : 0, 1e-6) << k;
}

// A mass on a spring with Coulomb friction: in each half period x turns from x0 to -(x0 - 2 mu N / c), and it stops
// where the spring is weaker than friction.
TEST(ContactMotion, FrictionOscillator) {
  constexpr double kSpring = 100, kMass = 2, kFriction = 0.2, kStart = 0.2;
  const double slide = kFriction * kMass * kGravity / kSpring, half = std::numbers::pi * std::sqrt(kMass / kSpring);
  const std::string text = fmt::format(
      "gravity = [0, 0, -9.81]\n[bodies.block]\ntype = \"rigid\"\nmass = 2\nbox = [0.4, 0.3, 0.1]\nposition = [{}, 0, "
      "{:.17g}]\n[surfaces.block]\nbody = \"block\"\nshape = \"box\"\nsize = [0.4, 0.3, 0.1]\n{}"
      "[joints.rail]\ntype = \"prismatic\"\na = {{ body = \"ground\", rotation = {{ axis = [0, 1, 0], angle = {:.17g} "
      "}}, point = [0, 0, {:.17g}] }}\nb = {{ body = \"block\", rotation = {{ axis = [0, 1, 0], angle = {:.17g} }} }}\n"
      "[forces.spring]\ntype = \"axial-spring\"\na = {{ body = \"ground\", rotation = {{ axis = [0, 1, 0], angle = "
      "{:.17g} }} }}\nb = {{ body = \"block\" }}\nstiffness = {}\nrest = 0\n"
      "[contacts.rub]\nsurfaces = [\"floor\", \"block\"]\nstiffness = 1e7\ntangential_stiffness = 1e7\nfriction = "
      "{}\noverlap = 1\ntangential_damping = 500\n{}",
      kStart, 0.05 - kMass * kGravity / 4e7, kFloor, std::numbers::pi / 2, 0.05 - kMass * kGravity / 4e7,
      std::numbers::pi / 2, std::numbers::pi / 2, kSpring, kFriction, integrator(5 * half, 1e-8));
  Simulation simulation;
  const Status loaded = simulation.load_text(text, "oscillator.toml");
  ASSERT_TRUE(loaded.ok()) << loaded.message;
  double x = kStart;
  for (int k = 1; k <= 2; ++k) {
    ASSERT_TRUE(simulation.step_to(k * half).ok());
    x = -std::copysign(std::abs(x) - 2 * slide, x);
    EXPECT_NEAR(simulation.value("block.position.x"), x, 1e-4 * kStart) << "turn " << k;
  }
  ASSERT_LT(std::abs(std::abs(x) - 2 * slide), slide);  // after the third it rests
  ASSERT_TRUE(simulation.step_to(5 * half).ok());
  EXPECT_NEAR(simulation.value("block.position.x"), x > 0 ? 2 * slide - x : -2 * slide - x, 2e-4 * kStart);
  EXPECT_EQ(simulation.value("rub.slipping"), 0);
}

// A ball that slides and then rolls keeps 5/7 of its speed, whatever the friction is.
TEST(ContactMotion, BallBeginsToRoll) {
  const double sink = 2 * kGravity / 1e7;
  const std::string text =
      "gravity = [0, 0, -9.81]\n" +
      ball("ball", 0.1, 2, fmt::format("position = [0, 0, {:.17g}]\nvelocity = [1, 0, 0]", 0.1 - sink)) + kFloor +
      "[contacts.floor-contact]\nsurfaces = [\"floor\", \"ball\"]\nstiffness = 1e7\nfriction = 0.3\n"
      "tangential_damping = 2e3\n" +
      integrator(0.3, 1e-8);
  const Simulation simulation = simulated(text);
  EXPECT_NEAR(simulation.value("ball.velocity.x"), 5.0 / 7, 2e-4);
  EXPECT_NEAR(simulation.value("ball.angular_velocity.y"), 5.0 / 7 / 0.1, 2e-3);
  const double slips = 2 / (7 * 0.3 * kGravity), way = slips - 0.5 * 0.3 * kGravity * slips * slips;
  EXPECT_NEAR(simulation.value("ball.position.x"), way + 5.0 / 7 * (0.3 - slips), 1e-5);
}

// Without friction and damping nothing is gained: boxes that tumble over each other.
TEST(ContactMotion, EnergyDoesNotGrow) {
  std::string text = "gravity = [0, 0, -9.81]\n" + kFloor;
  for (int k = 0; k < 3; ++k)
    text += fmt::format(
        "[bodies.box{0}]\ntype = \"rigid\"\nmass = 1\nbox = [0.2, 0.3, 0.1]\nposition = [{1}, 0, {2}]\nrotation = "
        "[0.3, "
        "{1}, 0.2]\n[surfaces.box{0}]\nbody = \"box{0}\"\nshape = \"sphere\"\nradius = 0.12\n",
        k, 0.05 * k, 0.3 + 0.3 * k);
  text += "[contacts.all]\nsurfaces = [\"box*\", \"floor\"]\nstiffness = 1e6\nexponent = 1.5\n" + integrator(0.6, 1e-9);
  Simulation simulation;
  ASSERT_TRUE(simulation.load_text(text, "boxes.toml").ok());
  const double start = simulation.value("energy.total");
  double most = start, touched = 0;
  const auto observe = [&](const SimulationStep&) {
    most = std::max(most, simulation.value("energy.total"));
    touched = std::max(touched, simulation.value("all.points"));
    return true;
  };
  ASSERT_TRUE(simulation.run(observe).ok());
  EXPECT_GT(touched, 1);
  EXPECT_LT(most, start + 1e-6 * std::abs(start));
}

// A saved state goes on with the same bits, contact history and all.
// A chain drops on its sprocket: nine rollers meet the teeth at once. Newton alone jumps to and fro between rollers
// that touch and rollers that do not; with its search the step needs no division. Truth: the same with a tenth of the
// step.
TEST(ContactMotion, StepsAreNotDividedWhereManyTouch) {
  const std::string model = content_of((espalier::test::source_folder() / "models/sprocket.toml").string());
  SimulationOptions options;
  options.set = {"output.csv_interval=false", "parameters.weight_side=42"};
  options.until = 0.004;
  const Simulation whole = simulated(model, options);
  EXPECT_EQ(whole.summary().divisions, 0);
  EXPECT_EQ(whole.summary().steps, 40);
  EXPECT_GE(whole.summary().newton_failures, 1);
  options.set.push_back("integrator.step=1e-5");
  const Simulation fine = simulated(model, options);
  EXPECT_NEAR(whole.value("weight.position.y"), fine.value("weight.position.y"), 2e-6);
}

TEST(ContactMotion, SavedStateGoesOn) {
  const std::string text = "gravity = [0, 0, -9.81]\n" +
                           ball("a", 0.1, 1, "position = [0, 0, 0.12]\nvelocity = [1, 0, 0]") +
                           ball("b", 0.1, 1, "position = [0.05, 0.02, 0.35]") + kFloor +
                           "[contacts.all]\nsurfaces = [\"*\"]\nstiffness = 1e5\nfriction = 0.3\nrestitution = 0.7\n" +
                           integrator(0.5, 1e-6);
  const auto end = [](Simulation& s) {
    EXPECT_TRUE(s.step_to(0.5).ok());
    return std::array{s.value("a.position.x"), s.value("b.position.z"), s.value("a.rotation.y")};
  };
  Simulation first, second;
  ASSERT_TRUE(first.load_text(text, "m.toml").ok());
  ASSERT_TRUE(second.load_text(text, "m.toml").ok());
  ASSERT_TRUE(first.step_to(0.21).ok());
  const std::string state = first.save();
  ASSERT_TRUE(second.restore(state).ok());
  EXPECT_EQ(end(first), end(second));
}

TEST(ContactMotion, MistakesNameBodyAndSurface) {
  const std::string start = ball("ball", 0.1, 2, "position = [0, 0, 0.2]") + kFloor;
  const std::string contact = "[contacts.c]\nsurfaces = [\"floor\", \"ball\"]\nstiffness = 1e5\n";
  const std::string rest = integrator(1, 1e-6);
  const auto message = [&](const std::string& text) {
    Simulation s;
    const Status status = s.load_text(text + rest, "m.toml");
    EXPECT_EQ(status.code, StatusCode::invalid_input) << text;
    return status.message;
  };
  const auto expect = [&](const std::string& text, const std::vector<std::string>& parts) {
    const std::string found = message(text);
    for (const std::string& part : parts) EXPECT_NE(found.find(part), std::string::npos) << part << " in: " << found;
  };
  expect(start + "[contacts.c]\nsurfaces = [\"flor\", \"ball\"]\nstiffness = 1e5\n", {"flor", "did you mean 'floor'"});
  expect(start + "[contacts.c]\nsurfaces = [\"floor\"]\nstiffness = 1e5\n", {"contacts.c", "no two surfaces"});
  expect(start + "[contacts.c]\nsurfaces = [\"*\"]\n", {"stiffness"});
  expect(start + contact + "friction = -1\n", {"friction", "negative"});
  expect(start + contact + "restitution = 1.5\n", {"restitution"});
  expect(start + contact + "slip = 1\n", {"slip"});
  expect(start + "[contacts.ball]\nsurfaces = [\"*\"]\nstiffness = 1\n", {"'ball' is taken"});
  expect(ball("ball", 0.1, 2, "position = [0, 0, 0.08]") + kFloor + contact,
         {"contacts.c", "'floor'", "'ball'", "overlap by 0.02", "at the start"});
  // The rail lifts the floor into the ball.
  expect(
      ball("ball", 0.1, 2, "position = [0, 0, 0.1]") +
          "[bodies.belt]\ntype = \"rigid\"\nmass = 5\nbox = [1, 1, 0.1]\nposition = [0, 0, -0.05]\n"
          "[joints.rail]\ntype = \"prismatic\"\na = { body = \"ground\", axis = [1, 0, 0] }\nb = { body = \"belt\" }\n"
          "[surfaces.floor]\nbody = \"belt\"\nshape = \"plane\"\npoint = [0, 0, 0.05]\n" +
          contact,
      {"contacts.c", "with all joints closed", "overlap by 0.05"});
  expect(start + contact +
             "[surfaces.x]\nbody = \"bal\"\nshape = \"box\"\nsize = [1, 1, 1]\n[contacts.d]\nsurfaces = "
             "[\"*\"]\nstiffness = 1\n",
         {"'bal'"});
  expect(start + contact +
             "[surfaces.x]\nbody = \"ball\"\nshape = \"mesh\"\nfile = \"none.stl\"\n[contacts.d]\n"
             "surfaces = [\"*\"]\nstiffness = 1\n",
         {"none.stl"});
}

}  // namespace contact_motion_test
}  // namespace espalier::dynamics

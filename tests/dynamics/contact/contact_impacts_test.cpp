// Impacts that take no time (law = "impulse"). Truth: closed forms, and conservation of momentum and energy.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace contact_impacts_test {

constexpr double kGravity = 9.81;
const std::string kDown = "gravity = [0, 0, -9.81]\n";
const std::string kFloor = "[surfaces.floor]\nbody = \"ground\"\nshape = \"plane\"\n";

std::string ball(const std::string& name, double radius, double mass, const std::string& more) {
  const double inertia = 0.4 * mass * radius * radius;
  return fmt::format(
      "[bodies.{0}]\ntype = \"rigid\"\nmass = {1}\ninertia = [{2:.17g}, {2:.17g}, {2:.17g}]\n{3}\n"
      "[surfaces.{0}]\nbody = \"{0}\"\nshape = \"sphere\"\nradius = {4}\n",
      name, mass, inertia, more, radius);
}

std::string impulses(const std::string& surfaces, double restitution, double stiffness = 1e6) {
  return fmt::format("[contacts.c]\nsurfaces = [{}]\nlaw = \"impulse\"\nstiffness = {:g}\nrestitution = {:g}\n",
                     surfaces, stiffness, restitution);
}

std::string integrator(double end, double tolerance) {
  return fmt::format("[integrator]\nend = {:.17g}\nrelative = {:g}\nabsolute = {:g}\n", end, tolerance, tolerance);
}

/// From rest at height kHeight above the floor; impact k at t_k, parts from it with v0 e^(k + 1).
constexpr double kHeight = 0.5, kRadius = 0.1, kMass = 2;
const double kSpeed = std::sqrt(2 * kGravity * kHeight);

std::string falling(double restitution, double stiffness = 1e6) {
  return kDown + ball("ball", kRadius, kMass, fmt::format("position = [0, 0, {}]", kRadius + kHeight)) + kFloor +
         impulses("\"floor\", \"ball\"", restitution, stiffness);
}

TEST(ContactImpacts, TenBouncesOfABall) {
  for (const double e : {1.0, 0.8}) {
    std::vector<double> times = {kSpeed / kGravity};
    for (int k = 1; k < 11; ++k) times.push_back(times.back() + 2 * kSpeed * std::pow(e, k) / kGravity);
    const double end = times[10] - 1e-3;
    Simulation run;
    const Status loaded = run.load_text(
        falling(e) + integrator(end, 1e-9) + "[events.down]\ncontact = \"c\"\nwhen = \"closes\"\ntolerance = 1e-10\n",
        "ball.toml");
    ASSERT_TRUE(loaded.ok()) << loaded.message;
    for (std::size_t k = 0; k < 10; ++k) {
      const Status status = run.step_to(0.5 * (times[k] + times[k + 1]));
      ASSERT_TRUE(status.ok()) << status.message;
      const double height = kHeight * std::pow(e, 2 * (k + 1));
      EXPECT_NEAR(run.value("ball.position.z"), kRadius + height, 1e-6 * kHeight) << "apex " << k;
      EXPECT_NEAR(run.value("ball.velocity.z"), 0, 1e-6 * kSpeed) << "apex " << k;
    }
    const auto& events = run.summary().events;
    ASSERT_EQ(events.size(), 10U);
    for (std::size_t k = 0; k < 10; ++k) EXPECT_NEAR(events[k].t, times[k], 1e-6 * times[0]) << "impact " << k;
    EXPECT_EQ(run.value("c.impacts"), 10);
    double impulse = 0;
    for (int k = 0; k < 10; ++k) impulse += kMass * kSpeed * std::pow(e, k) * (1 + e);
    EXPECT_NEAR(run.value("c.impulse"), impulse, 1e-6 * impulse);
  }
}

// Infinitely many bounces until t0 + 2 v0 / g e / (1 - e); then it rests on the spring.
TEST(ContactImpacts, InfinitelyManyBouncesComeToRest) {
  constexpr double kRest = 0.5;
  const double last = kSpeed / kGravity * (1 + 2 * kRest / (1 - kRest));
  for (const char* method : {"", "method = \"generalized-alpha\"\nstep = 2e-3\nspectral_radius = 0.7\n"}) {
    const std::string steps =
        *method == '\0' ? integrator(last + 1, 1e-8) : fmt::format("[integrator]\nend = {:.17g}\n{}", last + 1, method);
    Simulation run;
    ASSERT_TRUE(run.load_text(falling(kRest) + steps, "zeno.toml").ok());
    ASSERT_TRUE(run.step_to(last + 0.02).ok());
    EXPECT_LT(std::abs(run.value("ball.position.z") - kRadius), 5e-5);
    EXPECT_LT(std::abs(run.value("ball.velocity.z")), 1e-3);
    ASSERT_TRUE(run.step_to(last + 1).ok());
    EXPECT_NEAR(run.value("ball.position.z"), kRadius - kMass * kGravity / 1e6, 1e-9);
    EXPECT_NEAR(run.value("c.normal_force"), kMass * kGravity, 1e-4 * kMass * kGravity);
    EXPECT_EQ(run.value("c.points"), 1);
    // It rests once it would rise less than half of what it sinks: v < g sqrt(m / k).
    const double count = std::ceil(std::log(kGravity * std::sqrt(kMass / 1e6) / kSpeed) / std::log(kRest)) + 1;
    EXPECT_NEAR(run.value("c.impacts"), count, 1);
    EXPECT_LT(run.summary().steps, 3000);
  }
}

// Gaps that are open or none: the first ball stops, the last one leaves with all of it, and two balls send off two.
TEST(ContactImpacts, NewtonsCradle) {
  for (const double gap : {0.0, 1e-3})
    for (const int striking : {1, 2}) {
      std::string text;
      for (int k = 0; k < 5; ++k) {
        const bool strikes = k < striking;
        const double x = (0.1 + gap) * k - (strikes ? 0.01 : 0);
        text += ball(fmt::format("b{}", k), 0.05, 1,
                     fmt::format("position = [{:.17g}, 0, 0]\nvelocity = [{}, 0, 0]", x, strikes ? 1 : 0));
      }
      const Simulation run = simulated(text + impulses("\"b*\"", 1) + integrator(0.05, 1e-8));
      for (int k = 0; k < 5; ++k)
        EXPECT_NEAR(run.value(fmt::format("b{}.velocity.x", k)), k >= 5 - striking ? 1 : 0, 1e-9) << gap << " " << k;
    }
}

// Without restitution all go on together.
TEST(ContactImpacts, PlasticRow) {
  std::string text;
  for (int k = 0; k < 5; ++k)
    text += ball(fmt::format("b{}", k), 0.05, 1,
                 fmt::format("position = [{:.17g}, 0, 0]\nvelocity = [{}, 0, 0]", 0.1 * k - (k == 0 ? 0.01 : 0),
                             k == 0 ? 1 : 0));
  const Simulation run = simulated(text + impulses("\"b*\"", 0) + integrator(0.05, 1e-8));
  for (int k = 0; k < 5; ++k) EXPECT_NEAR(run.value(fmt::format("b{}.velocity.x", k)), 0.2, 1e-6) << k;
}

// A rod that falls on a plane at an angle: J = (1 + e) u m / (1 + m c^2 / I), c = l / 2 cos(angle) from the centre to
// the normal through the end that strikes (a ball of radius r).
TEST(ContactImpacts, EndOfARodStrikes) {
  constexpr double kLength = 1, kAngle = 0.6, kFall = 2, kEnd = 0.01, kRest = 0.7, kInertia = 0.2;
  const double c = 0.5 * kLength * std::cos(kAngle), low = 0.5 * kLength * std::sin(kAngle) + kEnd;
  const std::string rod = fmt::format(
      "[bodies.rod]\ntype = \"rigid\"\nmass = {}\ninertia = [0.01, {}, {}]\nposition = [0, 0, {:.17g}]\nvelocity = [0, "
      "0, {}]\nrotation = [0, {:.17g}, 0]\n[surfaces.rod]\nbody = \"rod\"\nshape = \"capsule\"\naxis = [1, 0, "
      "0]\nradius = "
      "{}\nlength = {}\n",
      kMass, kInertia, kInertia, low + 0.01, -kFall, kAngle, kEnd, kLength);
  const Simulation run = simulated(rod + kFloor + impulses("\"rod\", \"floor\"", kRest) + integrator(0.0055, 1e-9));
  const double impulse = (1 + kRest) * kFall * kMass / (1 + kMass * c * c / kInertia);
  ASSERT_EQ(run.value("c.impacts"), 1);
  EXPECT_NEAR(run.value("c.impulse"), impulse, 1e-9 * impulse);
  EXPECT_NEAR(run.value("rod.velocity.z"), -kFall + impulse / kMass, 1e-9);
  // The end that lies on the right is the lower one: rotated about y by a positive angle, x goes down.
  EXPECT_NEAR(run.value("rod.angular_velocity.y"), -impulse * c / kInertia, 1e-6);
}

// A pendulum in its lowest position strikes a stop with its tip: w+ = -e w-, the kinetic energy falls by 1 - e^2, and
// the hinge, whose reaction is m (g + w^2 l / 2) there, feels it.
TEST(ContactImpacts, PendulumStrikesAStop) {
  constexpr double kLength = 1, kRest = 0.6, kSwing = 3;
  const std::string text =
      kDown +
      fmt::format(
          "[bodies.bar]\ntype = \"rigid\"\nmass = {0}\ninertia = [{1:.17g}, {1:.17g}, 0.001]\nposition = [0, 0, {2}]\n"
          "velocity = [{3}, 0, 0]\nangular_velocity = [0, {4}, 0]\n[joints.hinge]\ntype = \"revolute\"\nbodies = "
          "[\"ground\", \"bar\"]\nat = [0, 0, 0]\naxis = [0, 1, 0]\n[surfaces.tip]\nbody = \"bar\"\nshape = "
          "\"sphere\"\nradius = 0.02\npoint = [0, 0, {2}]\n[surfaces.stop]\nbody = \"ground\"\nshape = "
          "\"plane\"\npoint = [0.02, 0, 0]\nnormal = [-1, 0, 0]\n",
          kMass, kMass * kLength * kLength / 12, -0.5 * kLength, 0.5 * kLength * kSwing, -kSwing) +
      impulses("\"tip\", \"stop\"", kRest);
  Simulation run;
  const Status loaded = run.load_text(text + integrator(1, 1e-9), "pendulum.toml");
  ASSERT_TRUE(loaded.ok()) << loaded.message;
  // It begins at the stop: the impact is the first thing that happens.
  const double inertia = kMass * kLength * kLength / 3, before = 0.5 * inertia * kSwing * kSwing;
  ASSERT_TRUE(run.step_to(1e-7).ok());
  EXPECT_EQ(run.value("c.impacts"), 1);
  const double after = kRest * kSwing;
  EXPECT_NEAR(run.value("bar.angular_velocity.y"), after, 1e-5 * after);
  EXPECT_NEAR(run.value("energy.kinetic"), kRest * kRest * before, 1e-6 * before);
  EXPECT_NEAR(run.value("c.impulse"), (1 + kRest) * kSwing * inertia / kLength, 1e-6);
  const double pull = kMass * (kGravity + after * after * 0.5 * kLength);
  EXPECT_NEAR(run.value("hinge.force.norm"), pull, 1e-5 * pull);
}

// Four corners strike at once: the box does not turn.
TEST(ContactImpacts, BoxLandsFlat) {
  const std::string text =
      kDown +
      "[bodies.box]\ntype = \"rigid\"\nmass = 2\nbox = [0.4, 0.3, 0.1]\nposition = [0, 0, 0.25]\n[surfaces.box]\n"
      "body = \"box\"\nshape = \"box\"\nsize = [0.4, 0.3, 0.1]\n" +
      kFloor + impulses("\"floor\", \"box\"", 0.5);
  const double v = std::sqrt(2 * kGravity * 0.2), first = v / kGravity;
  Simulation run;
  ASSERT_TRUE(run.load_text(text + integrator(2, 1e-9), "box.toml").ok());
  ASSERT_TRUE(run.step_to(first + 0.5 * v / kGravity).ok());
  EXPECT_NEAR(run.value("box.position.z"), 0.05 + 0.25 * 0.2, 1e-7);
  ASSERT_TRUE(run.step_to(2).ok());
  EXPECT_EQ(run.value("c.points"), 4);
  EXPECT_LT(std::abs(run.value("box.rotation.x")) + std::abs(run.value("box.rotation.y")), 1e-9);
  EXPECT_NEAR(run.value("box.position.z"), 0.05 - 2 * kGravity / 4e6, 1e-9);
}

/// Balls that fly about in a box of six planes.
std::string gas(double restitution, const std::string& more) {
  std::string text;
  for (int k = 0; k < 8; ++k)
    text += ball(
        fmt::format("b{}", k), 0.08 + 0.01 * k, 1 + 0.2 * k,
        fmt::format("position = [{}, {}, {}]\nvelocity = [{}, {}, {}]", 0.3 * (k & 1) - 0.15, 0.15 * (k & 2) - 0.15,
                    0.075 * (k & 4) - 0.15, std::sin(k + 1.0), std::cos(2.0 * k), std::sin(3.0 * k)));
  for (int k = 0; k < 6; ++k) {
    std::array<double, 3> normal{}, point{};
    normal.at(static_cast<std::size_t>(k / 2)) = k % 2 == 0 ? 1 : -1;
    point.at(static_cast<std::size_t>(k / 2)) = k % 2 == 0 ? -0.4 : 0.4;
    text += fmt::format(
        "[surfaces.wall{}]\nbody = \"ground\"\nshape = \"plane\"\npoint = [{}, {}, {}]\nnormal = [{}, "
        "{}, {}]\n",
        k, point[0], point[1], point[2], normal[0], normal[1], normal[2]);
  }
  return more + text + impulses("\"b*\", \"wall*\"", restitution);
}

TEST(ContactImpacts, EnergyIsKeptOrFalls) {
  for (const double e : {1.0, 0.8}) {
    Simulation run;
    ASSERT_TRUE(run.load_text(gas(e, "") + integrator(0.5, 1e-8), "gas.toml").ok());
    const double start = run.value("energy.total");
    double before = start, worst = 0;
    ASSERT_TRUE(run.run([&](const SimulationStep&) {
                     const double now = run.value("energy.total");
                     worst = std::max(worst, now - before);
                     before = now;
                     return true;
                   })
                    .ok());
    EXPECT_GT(run.value("c.impacts"), 10);
    EXPECT_LT(worst, 1e-9 * start);
    if (e == 1) {
      EXPECT_NEAR(before, start, 1e-8 * start);
    } else {
      EXPECT_LT(before, 0.9 * start);
    }
  }
}

TEST(ContactImpacts, SavedStateGoesOn) {
  const std::string text = gas(0.4, kDown) + integrator(0.6, 1e-6);
  const auto end = [](Simulation& s) {
    EXPECT_TRUE(s.step_to(0.6).ok());
    return std::array{s.value("b0.position.x"), s.value("b3.position.z"), s.value("c.impulse"), s.value("c.points")};
  };
  for (const double at : {0.2, 0.4}) {
    Simulation first, second;
    ASSERT_TRUE(first.load_text(text, "m.toml").ok());
    ASSERT_TRUE(second.load_text(text, "m.toml").ok());
    ASSERT_TRUE(first.step_to(at).ok());
    const std::string state = first.save();
    ASSERT_TRUE(second.restore(state).ok());
    EXPECT_EQ(end(first), end(second));
  }
}

TEST(ContactImpacts, MistakesAreNamed) {
  const auto mistake = [](const std::string& text) {
    Simulation simulation;
    const Status status = simulation.load_text(text, "m.toml");
    EXPECT_EQ(status.code, StatusCode::invalid_input) << text;
    return status.message;
  };
  const auto expect = [&](const std::string& text, const std::string& part) {
    const std::string found = mistake(text);
    EXPECT_NE(found.find(part), std::string::npos) << part << " in: " << found;
  };
  const std::string end = integrator(1, 1e-6);
  expect(falling(0.5) + "friction = -0.1\n" + end, "must not be negative");
  expect(falling(0.5) + "damping = 1\n" + end, "does not go with law = \"impulse\"");
  expect(falling(1.5) + end, "[0, 1]");
  std::string wrong = falling(0.5) + end;
  wrong.replace(wrong.find("\"impulse\""), 9, "\"impuls\"");
  expect(wrong, "impulse");
  expect(falling(0.5) + "[statics]\n", "is of motions");
  expect(kDown +
             "[bodies.block]\ntype = \"solid\"\nmesh = { part = \"block\", lx = 1, ly = 1, lz = 1, divisions = [1, "
             "1, 1] }\nmaterial = { young = 1000, poisson = 0.3, density = 1 }\n[surfaces.ball]\nbody = "
             "\"block\"\nshape = \"faces\"\n" +
             kFloor + impulses("\"ball\", \"floor\"", 0.5) + end,
         "is of rigid shapes");
  // A ball that a motor drives into the floor.
  Simulation driven;
  ASSERT_TRUE(driven
                  .load_text(ball("ball", 0.1, 1, "position = [0, 0, 0.2]") + kFloor +
                                 impulses("\"ball\", \"floor\"", 0.5) +
                                 "[joints.rail]\ntype = \"prismatic\"\nbodies = [\"ground\", \"ball\"]\naxis = [0, 0, "
                                 "1]\nat = [0, 0, 0.2]\n[joints.drive]\ntype = \"translation-motor\"\nbodies = "
                                 "[\"ground\", \"ball\"]\naxis = [0, 0, 1]\nat = [0, 0, 0.2]\nmotion = \"-t\"\n" +
                                 end,
                             "m.toml")
                  .ok());
  const Status status = driven.run();
  EXPECT_FALSE(status.ok());
  EXPECT_NE(status.message.find("no impulse can part them"), std::string::npos) << status.message;
}

}  // namespace contact_impacts_test
}  // namespace espalier::dynamics

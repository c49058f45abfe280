// Motions in pieces: steps to times of the caller's, states saved and restored in memory, series, the list of
// quantities. Truth: closed forms of piecewise constant accelerations, and the bits of a run that went on.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace {

const std::string kCart = R"toml([bodies.cart]
type = "point"
mass = 2
[inputs]
push = 0
[forces.push]
type = "load"
a = { body = "cart" }
force = ["inputs.push", 0, 0]
)toml";

// A cart on a rail under an input, with a hinge that an event opens.
const std::string kSwing =
    "gravity = [0, -10, 0]\n[inputs]\ntorque = 0\n" + hinged_bob("1e-2", "[1, 0, 0]") + R"toml([forces.motor]
type = "torque-motor"
a = { body = "ground", axis = [0, 0, 1] }
b = { body = "bob" }
torque = "inputs.torque"
[events.release]
when = "bob.position.x < 0"
off = ["hinge"]
once = true
[output]
quantities = ["bob.position"]
)toml";

const char* const kMethods[] = {"relative = 1e-9\nabsolute = 1e-9\nend = 3\n",
                                "method = \"generalized-alpha\"\nstep = 0.01\nend = 3\n"};

Simulation loaded(const std::string& text, SimulationOptions options = {}) {
  Simulation s(std::move(options));
  const Status status = s.load_text(text, "model.toml");
  EXPECT_TRUE(status.ok()) << status.message;
  return s;
}

void expect_ok(const Status& status) { EXPECT_TRUE(status.ok()) << status.message; }

// Two sums of the same steps differ by rounding: who asks for one time and then for the other asks for 1e-14 of a
// second.
TEST(Steps, AsShortAsRoundingDoNoHarm) {
  const std::string swing = kSwing.substr(0, kSwing.find("[events")) + "[integrator]\n";
  for (const char* method : kMethods) {
    Simulation plain = loaded(swing + method);
    expect_ok(plain.step_to(1));
    const double x = plain.value("bob.position.x"), y = plain.value("bob.position.y");
    const double force = plain.value("hinge.force.norm");
    for (const double sliver : {1e-18, 1e-16, 1e-14, 1e-12, 1e-10, 1e-8, 3e-7}) {
      Simulation s = loaded(swing + method);
      for (int k = 0; k <= 4; ++k) {
        expect_ok(s.step_to(s.time() + sliver));
        expect_ok(s.step_to(s.time() + 2 * sliver));
        EXPECT_NEAR(s.value("hinge.force.norm"), k == 0 ? 0 : s.value("hinge.force.norm"), 0.1) << method << sliver;
        expect_ok(s.step_to(0.2 * (k + 1)));
      }
      EXPECT_NEAR(s.value("bob.position.x"), x, 2e-6) << method << sliver;
      EXPECT_NEAR(s.value("bob.position.y"), y, 2e-6) << method << sliver;
      EXPECT_NEAR(s.value("hinge.force.norm"), force, 1e-3 * force) << method << sliver;
      EXPECT_LT(s.summary().steps, 2 * plain.summary().steps + 20) << method << sliver;
    }
  }
}

// Steps of a caller that are all shorter than what the method would take are steps of the method all the same, from a
// hundredth of its last step on.
TEST(Steps, MuchShorterThanTheMethodsFollowInputs) {
  for (const char* method : kMethods) {
    Simulation s = loaded(kCart + "[integrator]\n" + method);
    expect_ok(s.step_to(0.5));
    s.set_input("push", 2);
    for (int k = 1; k <= 3000; ++k) expect_ok(s.step_to(0.5 + k * 1e-6));
    EXPECT_NEAR(s.value("cart.velocity.x"), 3e-3, 1.1e-4) << method;
  }
}

TEST(Steps, EndWhereTheyAreAskedToAndFollowInputs) {
  Simulation s = loaded(kCart + "[integrator]\n" + kMethods[0]);
  double t = 0, x = 0, v = 0;
  for (int k = 0; k < 30; ++k) {
    const double push = 3.0 * ((k * 7) % 5 - 2), h = 0.02 + 0.01 * (k % 4);
    s.set_input("push", push);
    expect_ok(s.step_to(t + h));
    t += h;
    x += v * h + push / 2 * h * h / 2;
    v += push / 2 * h;
    EXPECT_EQ(s.time(), t);
    EXPECT_NEAR(s.value("cart.position.x"), x, 1e-6);
    EXPECT_NEAR(s.value("cart.velocity.x"), v, 1e-5);
  }
  expect_ok(s.step_to(t));  // nothing to do
  expect_ok(s.step_to(5));  // beyond the end of the model
  EXPECT_EQ(s.time(), 5);
  EXPECT_THROW((void)s.step_to(4), std::invalid_argument);
  EXPECT_THROW((void)s.step_to(std::nan("")), std::invalid_argument);
  EXPECT_THROW((void)s.step_to(std::numeric_limits<double>::infinity()), std::invalid_argument);
}

TEST(Steps, TheObserverStopsThemAndRunGoesOnToTheEnd) {
  ScratchFolder folder;
  SimulationOptions options;
  options.out = folder.path();
  Simulation s = loaded(kSwing + "[integrator]\n" + kMethods[0], options);
  expect_ok(s.step_to(1, [](const SimulationStep& step) { return step.index < 3; }));
  EXPECT_TRUE(s.summary().interrupted);
  EXPECT_EQ(s.summary().steps, 3);
  expect_ok(s.step_to(1));
  EXPECT_FALSE(s.summary().interrupted);
  expect_ok(s.run());
  EXPECT_EQ(s.time(), 3);
  const Simulation whole = simulated(kSwing + "[integrator]\n" + kMethods[0]);
  EXPECT_NEAR(s.value("bob.position.x"), whole.value("bob.position.x"), 1e-5);
  const std::string csv = content_of(folder.path() + "/quantities.csv");
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), s.summary().steps + 2);  // and a header, and the start
}

TEST(Steps, AnEventThatStopsEndsThem) {
  Simulation s =
      loaded(kCart + "[events.there]\nwhen = \"cart.position.x > 1\"\nstop = true\n[integrator]\n" + kMethods[0]);
  s.set_input("push", 2);
  expect_ok(s.step_to(3));
  EXPECT_EQ(s.summary().stopped_by, "there");
  EXPECT_NEAR(s.time(), std::sqrt(2.0), 1e-4);
  expect_ok(s.step_to(3));
  EXPECT_EQ(s.summary().stopped_by, "");
  EXPECT_EQ(s.time(), 3);
}

TEST(SavedStates, GoOnWithTheSameBitsHereAndElsewhere) {
  for (const char* method : kMethods) {
    SCOPED_TRACE(method);
    SimulationOptions options;
    options.keep_series = true;
    Simulation s = loaded(kSwing + "[integrator]\n" + method, options);
    s.set_input("torque", 0.5);
    expect_ok(s.step_to(0.2));
    const std::string state = s.save();
    const SimulationSeries before = s.series();
    s.set_input("torque", 0.25);
    expect_ok(s.step_to(2));
    ASSERT_EQ(s.summary().events.size(), 1U) << "the hinge has not opened";
    const double x = s.value("bob.position.x"), y = s.value("bob.position.y");
    const SimulationSeries first = s.series();
    EXPECT_EQ(s.value("hinge.force.norm"), 0);

    expect_ok(s.restore(state));  // the hinge is closed again
    EXPECT_EQ(s.time(), 0.2);
    EXPECT_EQ(s.inputs()[0].value, 0.5);
    EXPECT_GT(s.value("hinge.force.norm"), 1);
    EXPECT_EQ(s.series().t, before.t);
    EXPECT_EQ(s.series().values, before.values);
    s.set_input("torque", 0.25);
    expect_ok(s.step_to(2));
    EXPECT_EQ(s.value("bob.position.x"), x);
    EXPECT_EQ(s.value("bob.position.y"), y);
    EXPECT_EQ(s.series().t, first.t);
    EXPECT_EQ(s.series().values, first.values);

    Simulation other = loaded(kSwing + "[integrator]\n" + method);
    expect_ok(other.restore(state));
    other.set_input("torque", 0.25);
    expect_ok(other.step_to(2));
    EXPECT_EQ(other.value("bob.position.x"), x);
  }
}

TEST(SavedStates, WhatDoesNotFitChangesNothing) {
  Simulation s = loaded(kSwing + "[integrator]\n" + kMethods[0]);
  expect_ok(s.step_to(0.3));
  const std::string state = s.save();
  const double x = s.value("bob.position.x");
  Simulation other = loaded(kCart + "[integrator]\n" + kMethods[0]);
  std::vector<std::string> bad = {"", "nonsense", other.save(), state.substr(0, state.size() - 8), state + "x"};
  for (std::size_t at = 16; at < state.size(); at += 97) {
    bad.push_back(state);
    bad.back()[at] = static_cast<char>(bad.back()[at] ^ 4);
  }
  for (const std::string& bytes : bad) {
    const Status status = s.restore(bytes);
    EXPECT_EQ(status.code, StatusCode::invalid_input);
    EXPECT_NE(status.message.find("the saved state"), std::string::npos) << status.message;
    EXPECT_EQ(s.time(), 0.3);
    EXPECT_EQ(s.value("bob.position.x"), x);
  }
  expect_ok(s.step_to(0.4));
}

TEST(Series, HoldChosenQuantitiesOfEveryStep) {
  SimulationOptions options;
  options.keep_series = true;
  options.quantities = {"energy.total", "bob.position.x"};
  Simulation s = loaded(kSwing + "[integrator]\n" + kMethods[0], options);
  std::vector<double> t = {0}, x = {1};
  expect_ok(s.run([&](const SimulationStep& step) {
    t.push_back(step.t);
    x.push_back(s.value("bob.position.x"));
    return true;
  }));
  const SimulationSeries& series = s.series();
  const std::vector<std::string> names = {"bob.position.x", "bob.position.y", "bob.position.z", "energy.total"};
  EXPECT_EQ(series.names, names);
  EXPECT_EQ(series.t, t);
  ASSERT_EQ(series.values.size(), 4 * t.size());
  for (std::size_t k = 0; k < t.size(); ++k) EXPECT_EQ(series.values[4 * k], x[k]);
  for (std::size_t k = 0; k < 4; ++k)
    EXPECT_EQ(series.values[series.values.size() - 4 + k], s.summary().values[k].second);
  EXPECT_EQ(loaded(kSwing + "[integrator]\n" + kMethods[0]).series().t.size(), 0U);
  options.quantities = {"bob.positoin"};
  Simulation wrong(options);
  EXPECT_EQ(wrong.load_text(kSwing + "[integrator]\n" + kMethods[0], "model.toml").code, StatusCode::invalid_input);
}

TEST(Quantities, AreAllKnownAndHaveDimensions) {
  Simulation s = loaded(kSwing + "[integrator]\n" + kMethods[0]);
  const std::vector<SimulationQuantity> list = s.quantities();
  EXPECT_GT(list.size(), 40U);
  std::string of_force, of_angle, of_input = "?";
  for (const SimulationQuantity& q : list) {
    EXPECT_TRUE(std::isfinite(s.value(q.name))) << q.name;
    if (q.name == "hinge.force.x") of_force = q.dimension;
    if (q.name == "hinge.angular_speed") of_angle = q.dimension;
    if (q.name == "inputs.torque") of_input = q.dimension;
  }
  EXPECT_EQ(of_force, "force");
  EXPECT_EQ(of_angle, "angle/time");
  EXPECT_EQ(of_input, "");
}

// Newton's matrices of a beam are factorized by the sparse solver, which asks at every border of its work.
TEST(Interrupted, AStepIsTakenAgain) {
  const std::string beam = R"toml(gravity = [0, -10, 0]
[materials.rubber]
young = 1e7
density = 1000
[bodies.beam]
type = "beam"
start = [0, 0, 0]
end = [1, 0, 0]
elements = 10
radius = 0.02
material = "rubber"
[joints.hinge]
type = "revolute"
a = { body = "ground", axis = [0, 0, 1] }
b = { body = "beam", node = 1 }
)toml";
  for (const char* method : {"relative = 1e-5\nabsolute = 1e-5\nmax_order = 2\nend = 0.05\n",
                             "method = \"generalized-alpha\"\nstep = 0.002\nend = 0.05\n"}) {
    SCOPED_TRACE(method);
    const Simulation whole = simulated(beam + "[integrator]\n" + method);
    bool stop = false;
    SimulationOptions options;
    options.interrupted = [&stop] { return stop; };
    options.interrupted_every = 0;
    Simulation s = loaded(beam + "[integrator]\n" + method, options);
    int interrupted = 0;
    for (int k = 0; k < 1000 && s.time() < 0.05; ++k) {
      stop = k % 3 == 1;
      const double before = s.time();
      long left = 10;
      expect_ok(s.run([&](const SimulationStep&) { return --left > 0; }));
      if (!stop || s.time() != before) continue;
      EXPECT_TRUE(s.summary().interrupted);
      ++interrupted;
    }
    EXPECT_GT(interrupted, 0);
    EXPECT_EQ(s.time(), 0.05);
    EXPECT_NEAR(s.value("beam.position.y"), whole.value("beam.position.y"), 1e-5);
  }
}

// With a radius near 1 what Newton's iteration leaves in multipliers fades slowly: it must not grow from step to step.
// Truth: the same motion with a radius of 0.8, of the same order.
TEST(Steps, HardlyDampedOnesKeepTheForcesOfJoints) {
  const std::string model = R"toml(gravity = [0, 0, -9.81]
[bodies.a]
type = "rigid"
mass = 1.3
inertia = [0.02, 0.05, 0.04]
position = [0.5, 0, 0]
velocity = [0, 1.5, 0]
angular_velocity = [0, 0, 3]
[bodies.b]
type = "rigid"
mass = 0.7
inertia = [0.01, 0.02, 0.013]
position = [1.3, 0.1, 0]
[joints.ball]
type = "spherical"
a = { body = "ground", point = [0, 0, 0] }
b = { body = "a", point = [-0.5, 0, 0] }
[joints.hinge]
type = "revolute"
a = { body = "a", point = [0.5, 0.1, 0], axis = [0, 1, 0.2] }
b = { body = "b", point = [-0.3, 0, 0], axis = [0, 1, 0.2] }
[initial]
velocities = "project"
[output]
quantities = ["ball.force", "hinge.force"]
[integrator]
method = "generalized-alpha"
step = 3.125e-4
end = 1
)toml";
  Simulation damped = loaded(model);
  expect_ok(damped.run());
  Simulation s = loaded(model + "spectral_radius = 0.99\n");
  expect_ok(s.run());
  for (const char* name : {"ball.force.x", "ball.force.z", "hinge.force.x", "hinge.force.z"})
    EXPECT_NEAR(s.value(name), damped.value(name), 0.01 * std::abs(damped.value("ball.force.x"))) << name;
}

TEST(Steps, StaticsHasNone) {
  Simulation s = loaded(R"toml(gravity = [0, -10, 0]
[bodies.bob]
type = "rigid"
mass = 2
box = [1, 1, 1]
position = [1, 0, 0]
[joints.weld]
type = "fixed"
bodies = ["ground", "bob"]
at = [0, 0, 0]
[statics]
)toml");
  EXPECT_THROW((void)s.step_to(1), std::logic_error);
  EXPECT_THROW((void)s.save(), std::logic_error);
  EXPECT_THROW((void)s.restore(""), std::logic_error);
  EXPECT_THROW((void)Simulation().step_to(1), std::logic_error);
}

}  // namespace
}  // namespace espalier::dynamics

// Events, inputs and turns. Truth: closed forms of free fall and impacts, conservation of momentum, and a run without a
// break for restarts.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace {

const std::string kBall = R"toml(gravity = [0, 0, -10]
[bodies.ball]
type = "rigid"
mass = 2
box = [0.1, 0.1, 0.1]
position = [0, 0, 3]
velocity = [1, 0, 0]
)toml";

TEST(Events, FreeFallEndsWhereItsClosedFormSays) {
  for (const double tolerance : {1e-3, 1e-6, 1e-12})
    for (const char* method :
         {"max_step = 0.3\nrelative = 1e-9\nabsolute = 1e-9", "method = \"generalized-alpha\"\nstep = 0.01"}) {
      std::ostringstream text;
      text << kBall << "[integrator]\n"
           << method
           << "\nend = 10\n[events.ground]\nwhen = \"ball.position.z <= 0\"\nstop = true\ntolerance = " << tolerance
           << "\n";
      const Simulation s = simulated(text.str());
      // Not before the time, and within the tolerance after it (a constant acceleration is integrated without error).
      const double late = s.time() - std::sqrt(0.6);
      EXPECT_GE(late, -1e-9) << method;
      EXPECT_LE(late, tolerance + 1e-9) << method;
      EXPECT_LE(s.value("ball.position.z"), 0) << method;
      ASSERT_EQ(s.summary().events.size(), 1U);
      EXPECT_EQ(s.summary().events[0].name, "ground");
      EXPECT_FALSE(s.summary().interrupted);
    }
}

TEST(Events, SwitchOffAJoint) {
  // A pendulum that is let go at the bottom flies on along a parabola with the speed that it has.
  const Simulation s = simulated("gravity = [0, -10, 0]\n" + hinged_bob("1e-9", "[1, 0, 0]") + R"toml([events.release]
when = "bob.position.x < 0"
off = ["hinge"]
once = true
[events.landing]
when = "bob.position.y < -3"
stop = true
[integrator]
relative = 1e-10
absolute = 1e-10
end = 10
)toml");
  ASSERT_EQ(s.summary().events.size(), 2U);
  const double fall = std::sqrt(2 * 2 / 10.0);
  EXPECT_NEAR(s.summary().events[1].t - s.summary().events[0].t, fall, 1e-7);
  EXPECT_NEAR(s.value("bob.position.x"), -std::sqrt(20.0) * fall, 1e-6);
  EXPECT_EQ(s.value("hinge.force.norm"), 0);
  EXPECT_EQ(s.summary().degrees_of_freedom, 6);
}

TEST(Events, SwitchOnAJointAsAPlasticImpact) {
  // A cart of mass 2 with speed 3 meets one of mass 4 at rest and is coupled to it: both go on with 1, and two thirds
  // of the energy are gone.
  const Simulation s = simulated(R"toml([bodies.one]
type = "rigid"
mass = 2
box = [0.1, 0.1, 0.1]
velocity = [3, 0, 0]
[bodies.two]
type = "rigid"
mass = 4
box = [0.1, 0.1, 0.1]
position = [1, 0, 0]
[joints]
rail_one = { type = "prismatic", bodies = ["ground", "one"], at = [0, 0, 0], axis = [1, 0, 0] }
rail_two = { type = "prismatic", bodies = ["ground", "two"], at = [0, 0, 0], axis = [1, 0, 0] }
buffer = { type = "fixed", active = false, a = { body = "one", point = [0.1, 0, 0] }, b = { body = "two", point = [-0.1, 0, 0] } }
[events.meet]
when = "one.position.x + 0.1 >= two.position.x - 0.1"
on = ["buffer"]
tolerance = 1e-10
[integrator]
end = 1
)toml");
  ASSERT_EQ(s.summary().events.size(), 1U);
  EXPECT_NEAR(s.summary().events[0].t, 0.8 / 3, 1e-9);
  EXPECT_NEAR(s.value("one.velocity.x"), 1, 1e-9);
  EXPECT_NEAR(s.value("two.position.x"), 1 + 1 - 0.8 / 3, 1e-8);
  EXPECT_NEAR(s.summary().energy_end.kinetic, 3, 1e-8);
  bool said = false;
  for (const std::string& notice : s.summary().notices)
    said = said || notice.find("plastic impact") != std::string::npos;
  EXPECT_TRUE(said);
}

TEST(Events, AClutchHoldsTheAngleThatItFinds) {
  // A wheel at 6 rad/s is coupled to one at rest, three times as heavy, at t = 1: both go on at 1.5 rad/s, 6 rad apart.
  const Simulation s = simulated(R"toml([bodies.one]
type = "rigid"
mass = 1
inertia = [1, 1, 1]
angular_velocity = [0, 0, 6]
[bodies.two]
type = "rigid"
mass = 1
inertia = [1, 1, 3]
position = [0, 0, 1]
[joints]
shaft_one = { type = "revolute", bodies = ["ground", "one"], at = [0, 0, 0], axis = [0, 0, 1] }
shaft_two = { type = "revolute", bodies = ["ground", "two"], at = [0, 0, 1], axis = [0, 0, 1] }
clutch = { type = "rotation-motor", bodies = ["one", "two"], at = [0, 0, 0], axis = [0, 0, 1], motion = "0", from = "initial", active = false }
[events.clutch_in]
when = "t >= 1"
on = ["clutch"]
[integrator]
end = 3
)toml");
  EXPECT_NEAR(s.value("shaft_two.angular_speed"), 1.5, 1e-9);
  EXPECT_NEAR(s.value("shaft_one.angle") - s.value("shaft_two.angle"), 6, 1e-7);
}

TEST(Events, JointsThatDoNotFitAreNotSwitchedOn) {
  Simulation s;
  ASSERT_TRUE(s.load_text(kBall + R"toml([joints.latch]
type = "spherical"
active = false
a = { body = "ground", point = [0, 0, 1] }
b = { body = "ball" }
[events.catch]
when = "ball.position.z < 1"
on = ["latch"]
[integrator]
end = 2
)toml",
                          "model.toml")
                  .ok());
  const Status status = s.run();
  EXPECT_EQ(status.code, StatusCode::invalid_input);
  for (const char* word : {"model.toml:13", "events.catch", "had to change by"})
    EXPECT_NE(status.message.find(word), std::string::npos) << status.message;
}

TEST(Events, SwitchForcesAndSetInputs) {
  // A motor pushes with 4 until the speed is 2, then a brake of 1 comes on and takes it off; at rest everything ends.
  const Simulation s = simulated(R"toml([inputs]
push = 4
[bodies.cart]
type = "rigid"
mass = 2
box = [0.1, 0.1, 0.1]
[joints.rail]
type = "prismatic"
bodies = ["ground", "cart"]
at = [0, 0, 0]
axis = [1, 0, 0]
[forces.motor]
type = "force-motor"
bodies = ["ground", "cart"]
at = [0, 0, 0]
axis = [1, 0, 0]
force = "inputs.push"
[forces.brake]
type = "load"
active = false
a = { body = "cart" }
force = [-1, 0, 0]
[events.fast]
when = "rail.speed > 2"
set = { push = 0 }
on = ["brake"]
tolerance = 1e-11
[events.rest]
when = "min(-rail.speed, t - 0.1) > 0"
stop = true
tolerance = 1e-11
[integrator]
relative = 1e-9
absolute = 1e-10
end = 20
)toml");
  ASSERT_EQ(s.summary().events.size(), 2U);
  EXPECT_NEAR(s.summary().events[0].t, 1, 1e-8);
  EXPECT_NEAR(s.time(), 5, 1e-7);
  EXPECT_NEAR(s.value("rail.displacement"), 1 + 4, 1e-7);
  EXPECT_EQ(s.value("inputs.push"), 0);
}

TEST(Events, RestartThroughOneGivesTheSameBits) {
  const std::string text = R"toml(gravity = [0, -10, 0]
[inputs]
level = 1
[bodies.bob]
type = "rigid"
mass = 2
inertia = [1e-3, 1e-3, 1e-3]
position = [1, 0, 0]
[joints]
hinge = { type = "revolute", bodies = ["ground", "bob"], at = [0, 0, 0], axis = [0, 0, 1] }
fourth = { type = "prescribed", active = false, direction = "y", motion = "-1.5", a = { body = "ground" }, b = { body = "bob" } }
[forces.spin]
type = "torque-motor"
bodies = ["ground", "bob"]
at = [0, 0, 0]
axis = [0, 0, 1]
torque = "inputs.level*3 - 0.2*hinge.angular_speed"
[events.first]
when = "hinge.angle < -1"
set = { level = -1 }
[events.second]
when = "bob.position.y < -0.95"
off = ["hinge", "spin"]
[output]
quantities = ["bob.position", "bob.velocity", "bob.rotation", "hinge.angle"]
[integrator]
)toml";
  for (const char* method : {"relative = 1e-7\nabsolute = 1e-8\n", "method = \"generalized-alpha\"\nstep = 0.004\n"}) {
    const std::string model = text + method + "end = 1\n";
    for (const double cut : {0.2, 0.45, 0.8}) {  // before, between and behind the events
      const ScratchFolder one, two;
      SimulationOptions options;
      options.out = one.path();
      options.set = {"output.exact_times=true", "output.restart_interval=" + fmt::format("{:f}", cut)};
      static_cast<void>(simulated(model, options));
      options.out = two.path();
      options.until = cut;
      static_cast<void>(simulated(model, options));
      options.until.reset();
      options.restart = two.path() + "/state.restart";
      const Simulation rest = simulated(model, options);
      EXPECT_EQ(content_of(one.path() + "/quantities.csv"), content_of(two.path() + "/quantities.csv"))
          << method << cut;
      EXPECT_GE(rest.summary().events.size(), cut > 0.5 ? 0U : 1U);
    }
  }
}

TEST(Events, ThatHoldAtTheStartHappenThere) {
  const Simulation s =
      simulated(kBall + "[events.low]\nwhen = \"ball.position.z < 5\"\nstop = true\n[integrator]\nend = 1\n");
  EXPECT_EQ(s.time(), 0);
  EXPECT_EQ(s.summary().stopped_by, "low");
}

TEST(Events, ThatSetEachOtherOffAreAnError) {
  Simulation s;
  ASSERT_TRUE(s.load_text(R"toml([inputs]
a = 0
[events.up]
when = "inputs.a < 0.5"
set = { a = 1 }
[events.down]
when = "inputs.a > 0.5"
set = { a = 0 }
)toml" + kBall.substr(kBall.find("[bodies")) +
                              "[integrator]\nend = 1\n",
                          "model.toml")
                  .ok());
  const Status status = s.run();
  EXPECT_EQ(status.code, StatusCode::invalid_input);
  EXPECT_NE(status.message.find("set each other off"), std::string::npos) << status.message;
}

TEST(Inputs, AProgramSetsThemDuringARun) {
  // A controller in the program, sampled at every step of 1 ms: holds 2 m above the ground against gravity.
  const std::string text = kBall + R"toml([inputs]
thrust = 0
[joints.rail]
type = "prismatic"
bodies = ["ground", "ball"]
at = [0, 0, 3]
axis = [0, 0, 1]
[forces.jet]
type = "load"
a = { body = "ball" }
force = [0, 0, "inputs.thrust"]
[integrator]
method = "generalized-alpha"
step = 1e-3
end = 10
[initial]
velocities = "project"
)toml";
  Simulation s;
  ASSERT_TRUE(s.load_text(text, "model.toml").ok());
  ASSERT_EQ(s.inputs().size(), 1U);
  EXPECT_EQ(s.inputs()[0].name, "thrust");
  EXPECT_EQ(s.inputs()[0].value, 0);
  EXPECT_THROW(s.set_input("trust", 1), std::invalid_argument);
  EXPECT_THROW(s.set_input("thrust", std::nan("")), std::invalid_argument);
  ASSERT_TRUE(s.run([&](const SimulationStep&) {
                 s.set_input("thrust", 20 - 30 * (s.value("ball.position.z") - 2) - 15 * s.value("ball.velocity.z"));
                 return true;
               }).ok());
  EXPECT_NEAR(s.value("ball.position.z"), 2, 1e-6);
  EXPECT_NEAR(s.inputs()[0].value, 20, 1e-4);
}

TEST(Turns, AreCountedInBothDirections) {
  // A rotor that is driven 40 turns forwards and 60 back; the angle is a quantity of hinge and spring.
  for (const char* method :
       {"relative = 1e-8\nabsolute = 1e-8\nend = 10", "method = \"generalized-alpha\"\nstep = 0.02\nend = 10"}) {
    const std::string text = std::string(R"toml([bodies.rotor]
type = "rigid"
mass = 4
inertia = [0.1, 0.1, 0.2]
[joints]
hinge = { type = "revolute", bodies = ["ground", "rotor"], at = [0, 0, 0], axis = [0, 0, 1] }
motor = { type = "rotation-motor", bodies = ["ground", "rotor"], at = [0, 0, 0], axis = [0, 0, 1], motion = "2*pi*(40*step(t, 0, 0, 4, 1) - 60*step(t, 5, 0, 10, 1))" }
[forces.coil]
type = "rotational-spring"
bodies = ["ground", "rotor"]
at = [0, 0, 0]
axis = [0, 0, 1]
stiffness = 0.5
rest = 0
[integrator]
)toml") + method + "\n";
    SimulationOptions options;
    options.until = 4.5;
    EXPECT_NEAR(simulated(text, options).value("hinge.angle"), 80 * std::numbers::pi, 1e-6) << method;
    const Simulation s = simulated(text);
    EXPECT_NEAR(s.value("hinge.angle"), -40 * std::numbers::pi, 1e-6) << method;
    EXPECT_NEAR(s.value("motor.angle"), -40 * std::numbers::pi, 1e-6) << method;
    EXPECT_NEAR(s.value("coil.coordinate"), -40 * std::numbers::pi, 1e-6) << method;
    // The motor holds the coil: its moment on the rotor is that of 20 turns.
    EXPECT_NEAR(s.value("motor.moment.z"), -0.5 * 40 * std::numbers::pi, 5e-3) << method;
  }
}

}  // namespace
}  // namespace espalier::dynamics

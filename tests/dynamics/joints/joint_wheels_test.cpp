// Gear pairs, racks and worms whose axes move, cables through rings. Truth: Willis's formula, balances of forces and
// moments, Atwood's machine; and that what they do is the same at other scales.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace joint_wheels_test {

constexpr double kPi = std::numbers::pi;
const std::string kAccurate = "[integrator]\nrelative = 1e-9\nabsolute = 1e-11\n";

std::string wheel(const std::string& name, double mass, double inertia, const std::string& more) {
  return fmt::format("[bodies.{}]\ntype = \"rigid\"\nmass = {}\ninertia = [1, 1, {}]\n{}\n", name, mass, inertia, more);
}

/// Sun of 20 teeth, planet of 15, ring of 50 on the ground; centres 0.35 apart.
std::string planetary(const std::string& drive) {
  const std::string axis = ", axis = [0, 0, 1]";
  return "gravity = [0, 0, 0]\n" + wheel("sun", 1, 0.2, "") + wheel("carrier", 3, 0.5, "") +
         wheel("planet", 2, 0.1, "position = [0.35, 0, 0]") +
         "[joints.sun-bearing]\ntype = \"revolute\"\nbodies = [\"ground\", \"sun\"]\nat = [0, 0, 0]\naxis = [0, 0, 1]\n"
         "[joints.main-bearing]\ntype = \"revolute\"\nbodies = [\"ground\", \"carrier\"]\nat = [0, 0, 0]\naxis = [0, "
         "0, 1]\n"
         "[joints.pin]\ntype = \"revolute\"\nbodies = [\"carrier\", \"planet\"]\nat = [0.35, 0, 0]\naxis = [0, 0, 1]\n"
         "[joints.outer]\ntype = \"gear-pair\"\na = { body = \"sun\"" +
         axis +
         " }\nb = { body = \"planet\" }\nteeth = [20, 15]\n[joints.inner]\ntype = \"gear-pair\"\na = { body = "
         "\"planet\" }\nb = { body = \"ground\"" +
         axis + " }\nteeth = [15, 50]\ninner = \"b\"\n" + drive;
}

TEST(GearPair, PlanetaryGearFollowsWillis) {
  // w_carrier = w_sun 20 / (20 + 50); the planet turns at w_carrier - (w_sun - w_carrier) 20 / 15. Some rounds.
  const Simulation s = simulated(planetary(
      "[joints.motor]\ntype = \"rotation-motor\"\nbodies = [\"ground\", \"sun\"]\nat = [0, 0, 0]\naxis = [0, 0, "
      "1]\nmotion = \"12 * t\"\n[initial]\nvelocities = \"project\"\n" +
      kAccurate + "end = 7\n"));
  const double carrier = 12.0 * 20 / 70;
  EXPECT_EQ(s.summary().degrees_of_freedom, 0);
  EXPECT_NEAR(s.value("main-bearing.angular_speed"), carrier, 1e-7);
  EXPECT_NEAR(s.value("main-bearing.angle"), 7 * carrier, 1e-6);
  EXPECT_NEAR(s.value("planet.angular_velocity.z"), carrier - (12 - carrier) * 20 / 15, 1e-6);
}

TEST(GearPair, ForcesActAtTheTeeth) {
  // At rest under a torque of 8 on the sun and 28 = 8 * 70 / 20 back on the carrier. The teeth take 8 / 0.2 at the
  // sun, as much at the ring, and the pin both.
  const std::string loads =
      "[forces.drive]\ntype = \"load\"\na = { body = \"sun\" }\nmoment = [0, 0, 8]\n[forces.back]\ntype = \"load\"\na "
      "= { "
      "body = \"carrier\" }\nmoment = [0, 0, -28]\n";
  const Simulation s = simulated(planetary(loads + kAccurate + "end = 0.5\n"));
  EXPECT_EQ(s.summary().degrees_of_freedom, 1);
  EXPECT_NEAR(s.value("main-bearing.angle"), 0, 1e-9);
  EXPECT_NEAR(std::abs(s.value("outer.tooth_force")), 40, 1e-7);
  EXPECT_NEAR(std::abs(s.value("inner.tooth_force")), 40, 1e-7);
  EXPECT_NEAR(s.value("outer.force.y"), 40, 1e-7);  // on the planet, at its centre, with a moment of 40 * 0.15
  EXPECT_NEAR(s.value("outer.moment.z"), -6, 1e-7);
  EXPECT_NEAR(s.value("inner.a.position.x"), 0.35, 1e-9);
  EXPECT_NEAR(s.value("inner.force.y"), -40, 1e-7);  // on the ring
  EXPECT_NEAR(s.value("pin.force.y"), -80, 1e-7);
  EXPECT_NEAR(s.value("sun-bearing.force.y"), 40, 1e-7);
  // Under the torque of the sun alone it runs up: energy is what the torque has done.
  const Simulation runs = simulated(planetary(loads.substr(0, loads.find("[forces.back]")) + kAccurate + "end = 2\n"));
  EXPECT_NEAR(runs.value("energy.kinetic"), 8 * runs.value("sun-bearing.angle"), 1e-4);
  EXPECT_GT(runs.value("sun-bearing.angle"), 4 * kPi);
}

TEST(GearPair, TeethAtAPressureAnglePressTheWheelsApart) {
  // As above, teeth at 20 degrees: each mesh adds 40 tan(20 degrees) on the planet, away from the sun and back from the
  // ring; the sun's bearing carries its own share, whichever way the torque goes.
  const double radial = 40 * std::tan(kPi / 9);
  for (const int way : {1, -1}) {
    std::string text = planetary(
        fmt::format("[forces.drive]\ntype = \"load\"\na = {{ body = \"sun\" }}\nmoment = [0, 0, {}]\n[forces.back]\n"
                    "type = \"load\"\na = {{ body = \"carrier\" }}\nmoment = [0, 0, {}]\n",
                    way * 8, way * -28) +
        kAccurate + "end = 0.5\n");
    const std::string keys[] = {"teeth = [20, 15]\n", "teeth = [15, 50]\n"};
    for (const std::string& key : keys) text.insert(text.find(key), "pressure_angle = \"pi / 9\"\n");
    const Simulation s = simulated(text);
    EXPECT_NEAR(s.value("main-bearing.angle"), 0, 1e-9);
    EXPECT_NEAR(std::abs(s.value("outer.tooth_force")), 40, 1e-7);
    EXPECT_NEAR(s.value("sun-bearing.force.x"), radial, 1e-6);  // on the sun: holds it where the planet pushes it back
    EXPECT_NEAR(s.value("sun-bearing.force.y"), way * 40, 1e-6);
    EXPECT_NEAR(s.value("pin.force.x"), 0, 1e-6);  // pushed out by the sun, in by the ring
    EXPECT_NEAR(s.value("pin.force.y"), way * -80, 1e-6);
    EXPECT_NEAR(s.value("outer.separating_force"), radial, 1e-6);
    EXPECT_NEAR(s.value("inner.separating_force"), -radial, 1e-6);
  }
}

TEST(GearPair, FrictionTakesItsShareOfThePower) {
  // Two wheels in bearings: the first turns at 30, the other one is braked by 5. The teeth carry F = 5 / 0.4 and what
  // friction takes, mu N with N = F / cos(angle); the motor pays for both: friction slows the pitch lines against each
  // other, so that it acts on the first wheel alone in this frame of reference.
  const double mu = 0.02, angle = kPi / 9, force = 5 / 0.4;
  const Simulation s = simulated(
      "gravity = [0, 0, 0]\n" + wheel("one", 1, 0.2, "") + wheel("two", 2, 0.3, "position = [0.6, 0, 0]") +
      "[joints.first]\ntype = \"revolute\"\nbodies = [\"ground\", \"one\"]\nat = [0, 0, 0]\naxis = [0, 0, 1]\n"
      "[joints.second]\ntype = \"revolute\"\nbodies = [\"ground\", \"two\"]\nat = [0.6, 0, 0]\naxis = [0, 0, 1]\n"
      "[joints.mesh]\ntype = \"gear-pair\"\na = { body = \"one\", axis = [0, 0, 1] }\nb = { body = \"two\" }\nteeth = "
      "[10, 20]\npressure_angle = \"pi / 9\"\nfriction = { coefficient = 0.02, slip_speed = 1e-3 }\n"
      "[joints.motor]\ntype = \"rotation-motor\"\nbodies = [\"ground\", \"one\"]\nat = [0, 0, 0]\naxis = [0, 0, "
      "1]\nmotion = \"30 * t\"\n[forces.brake]\ntype = \"load\"\na = { body = \"two\" }\nmoment = [0, 0, 5]\n"
      "[initial]\nvelocities = \"project\"\n" +
      kAccurate + "end = 0.5\n");
  EXPECT_NEAR(std::abs(s.value("mesh.tooth_force")), force, 1e-6);
  const double lost = mu * force / std::cos(angle) * 0.2 * 30;
  EXPECT_NEAR(std::abs(s.value("motor.moment.z")) * 30, 5 * 15 + lost, 1e-4 * lost);
}

TEST(GearPair, MovesWithItsFrameOfReference) {
  // Two free wheels far from everything, no carrier: momentum stays, and the pitch circles roll.
  const Simulation s =
      simulated("gravity = [0, 0, 0]\n" + wheel("one", 1, 0.2, "angular_velocity = [0, 0, 9]") +
                wheel("two", 2, 0.3, "position = [0.6, 0, 0]") +
                "[joints.centres]\ntype = \"distance\"\na = { body = \"one\" }\nb = { body = \"two\" }\n"
                "[joints.flat]\ntype = \"planar\"\na = { body = \"ground\", axis = [0, 0, 1] }\nb = { body = "
                "\"one\" }\n[joints.level]\ntype = \"planar\"\na = { body = \"ground\", axis = [0, 0, 1] }\nb = "
                "{ body = \"two\" }\n[joints.mesh]\ntype = \"gear-pair\"\na = { body = \"one\", axis = [0, 0, 1] "
                "}\nb = { body = \"two\" }\nteeth = [10, 20]\n[initial]\nvelocities = \"project\"\n" +
                kAccurate + "end = 3\n");
  const double mass_one = 1, mass_two = 2;
  EXPECT_NEAR(mass_one * s.value("one.velocity.x") + mass_two * s.value("two.velocity.x"), 0, 1e-7);
  EXPECT_NEAR(mass_one * s.value("one.velocity.y") + mass_two * s.value("two.velocity.y"), 0, 1e-7);
  const double x = s.value("two.position.x") - s.value("one.position.x");
  const double y = s.value("two.position.y") - s.value("one.position.y");
  const double vx = s.value("two.velocity.x") - s.value("one.velocity.x");
  const double vy = s.value("two.velocity.y") - s.value("one.velocity.y");
  const double line = (x * vy - y * vx) / (x * x + y * y);
  EXPECT_NEAR(0.2 * (s.value("one.angular_velocity.z") - line) + 0.4 * (s.value("two.angular_velocity.z") - line), 0,
              1e-7);
  EXPECT_GT(std::abs(line), 0.01);
}

/// A pinion of radius 0.2 and inertia 0.03 on a cart; a rack beside it.
std::string rack_and_cart(const std::string& rack, const std::string& more, double scale = 1) {
  return fmt::format(
             "gravity = [0, 0, 0]\n[bodies.cart]\ntype = \"rigid\"\nmass = 3\ninertia = [1, 1, "
             "1]\n[bodies.pinion]\ntype = "
             "\"rigid\"\nmass = 2\ninertia = [{0}, {0}, {0}]\n[bodies.rack]\ntype = \"rigid\"\nmass = 4\ninertia = [1, "
             "1, "
             "1]\nposition = [0, {1}, 0]\n",
             0.03 * scale * scale, -0.2 * scale) +
         "[joints.rail]\ntype = \"prismatic\"\nbodies = [\"ground\", \"cart\"]\nat = [0, 0, 0]\naxis = [1, 0, "
         "0]\n[joints.pin]\ntype = \"revolute\"\nbodies = [\"cart\", \"pinion\"]\nat = [0, 0, 0]\naxis = [0, 0, "
         "1]\n[joints.slide]\nbodies = [\"ground\", \"rack\"]\nat = [0, 0, 0]\naxis = [1, 0, 0]\ntype = \"" +
         rack +
         "\"\n[joints.teeth]\ntype = \"rack-pair\"\na = { body = \"rack\", axis = [1, 0, 0] }\nb = { body = "
         "\"pinion\", axis = [0, 0, 1] }\n" +
         more;
}

TEST(RackPair, TeethAtAPressureAnglePressThePinionOff) {
  // The pinion, above the rack, is turned against a cart that is held: it is lifted by tan(angle) times what it pulls.
  for (const int way : {1, -1}) {
    std::string text = rack_and_cart(
        "fixed",
        fmt::format("[forces.spin]\ntype = \"load\"\na = {{ body = \"pinion\" }}\nmoment = [0, 0, {}]\n", way * 6) +
            kAccurate + "end = 0.1\n");
    text.replace(text.find("\"prismatic\""), 11, "\"fixed\"");
    text.insert(text.find("a = { body = \"rack\""), "pressure_angle = \"pi / 9\"\n");
    const Simulation s = simulated(text);
    const double pull = 6 / 0.2;
    EXPECT_NEAR(std::abs(s.value("teeth.tooth_force")), pull, 1e-6);
    EXPECT_NEAR(s.value("slide.force.y"), pull * std::tan(kPi / 9), 1e-6);  // holds the rack, which is pressed down
    EXPECT_NEAR(s.value("teeth.separating_force"), pull * std::tan(kPi / 9), 1e-6);
  }
}

TEST(RackPair, PinionRollsOnARackAtRest) {
  for (const double scale : {1e-3, 1.0, 1e3}) {
    // F on the cart: (m + J / R^2) a = F, the rack takes J a / R^2.
    const Simulation s = simulated(
        rack_and_cart("fixed",
                      fmt::format("[forces.pull]\ntype = \"load\"\na = {{ body = \"cart\" }}\nforce = [{}, 0, 0]\n"
                                  "[integrator]\nrelative = 1e-9\nabsolute = {}\nend = 3\n",
                                  10 * scale, 1e-11 * scale),
                      scale));
    const double a = 10 / (5 + 0.03 / 0.04) * scale;
    EXPECT_NEAR(s.value("rail.speed"), 3 * a, 1e-6 * scale);
    EXPECT_NEAR(s.value("pin.angle"), -4.5 * a / (0.2 * scale), 1e-5);
    EXPECT_NEAR(std::abs(s.value("teeth.tooth_force")), 0.03 / 0.04 * a, 1e-6 * scale);
    EXPECT_NEAR(s.value("teeth.moment.z"), -0.03 / 0.2 * a * scale, 1e-6 * scale * scale);
    EXPECT_NEAR(s.value("teeth.force.x"), -0.03 / 0.04 * a, 1e-6 * scale);
  }
}

TEST(RackPair, BothMoveAndMomentumStays) {
  const Simulation s = simulated(rack_and_cart(
      "prismatic",
      "[forces.spin]\ntype = \"torque-motor\"\nbodies = [\"cart\", \"pinion\"]\nat = [0, 0, 0]\naxis = [0, 0, "
      "1]\ntorque = 0.6\n" +
          kAccurate + "end = 1\n"));
  const double cart = s.value("rail.speed"), rack = s.value("slide.speed"), spin = s.value("pin.angular_speed");
  EXPECT_NEAR(5 * cart + 4 * rack, 0, 1e-8);
  EXPECT_NEAR(rack - cart, 0.2 * spin, 1e-8);
  EXPECT_NEAR(s.value("energy.kinetic"), 0.6 * s.value("pin.angle"), 1e-7);
  EXPECT_GT(spin, 1);
}

/// A worm of radius 0.05 along x, its wheel of radius 0.2 above it, about y.
std::string worm_drive(const std::string& friction, const std::string& more, double lead = 0.06) {
  return fmt::format(
      "gravity = [0, 0, 0]\n[bodies.worm]\ntype = \"rigid\"\nmass = 1\ninertia = [0.01, 0.01, "
      "0.01]\n[bodies.wheel]\ntype "
      "= \"rigid\"\nmass = 2\ninertia = [0.3, 0.3, 0.3]\nposition = [0, 0, 0.25]\n[joints.worm-bearing]\ntype = "
      "\"revolute\"\nbodies = [\"ground\", \"worm\"]\nat = [0, 0, 0]\naxis = [1, 0, 0]\n[joints.wheel-bearing]\ntype = "
      "\"revolute\"\nbodies = [\"ground\", \"wheel\"]\nat = [0, 0, 0.25]\naxis = [0, 1, 0]\n[joints.thread]\ntype = "
      "\"worm\"\na = {{ body = \"worm\", axis = [1, 0, 0] }}\nb = {{ body = \"wheel\", axis = [0, 1, 0] }}\nlead = "
      "{}\nradius = 0.2\n{}\n{}",
      lead, friction, more);
}

TEST(Worm, TurnsItsWheelAndBearsItsForces) {
  const double ratio = 0.06 / (2 * kPi * 0.2);
  const Simulation s = simulated(worm_drive(
      "",
      "[joints.motor]\ntype = \"rotation-motor\"\nbodies = [\"ground\", \"worm\"]\nat = [0, 0, 0]\naxis = [1, 0, "
      "0]\nmotion = \"40 * t\"\n[forces.back]\ntype = \"load\"\na = { body = \"wheel\" }\nmoment = [0, 5, "
      "0]\n[initial]\nvelocities = \"project\"\n" +
          kAccurate + "end = 2\n"));
  // A right-handed thread that turns about +x below the wheel moves its teeth to -x, the wheel about +y.
  EXPECT_NEAR(s.value("wheel-bearing.angular_speed"), 40 * ratio, 1e-7);
  EXPECT_NEAR(s.value("wheel-bearing.angle"), 80 * ratio, 1e-6);
  EXPECT_NEAR(std::abs(s.value("thread.tooth_force")), 5 / 0.2, 1e-6);
  EXPECT_NEAR(s.value("motor.moment.x"), -5 * ratio, 1e-6);
  // At the pitch point, 0.2 below the wheel's centre: 25 along x, which turns the wheel back, and 25 tan across.
  const double across = 25 * 0.06 / (2 * kPi * 0.05);
  EXPECT_NEAR(s.value("thread.force.x"), 25, 1e-6);
  EXPECT_NEAR(std::abs(s.value("thread.force.y")), across, 1e-6);
  EXPECT_NEAR(s.value("thread.moment.y"), -5, 1e-6);
  EXPECT_NEAR(s.value("thread.moment.x"), 0.2 * s.value("thread.force.y"), 1e-6);  // (0, 0, -0.2) x force
  EXPECT_NEAR(s.value("worm-bearing.force.x"), 25, 1e-6);
  EXPECT_NEAR(s.value("wheel-bearing.force.y"), -s.value("thread.force.y"), 1e-6);
  const Simulation left = simulated(worm_drive(
      "",
      "[joints.motor]\ntype = \"rotation-motor\"\nbodies = [\"ground\", \"worm\"]\nat = [0, 0, 0]\naxis = [1, 0, "
      "0]\nmotion = \"40 * t\"\n[initial]\nvelocities = \"project\"\n" +
          kAccurate + "end = 0.5\n",
      -0.06));
  EXPECT_NEAR(left.value("wheel-bearing.angular_speed"), -40 * ratio, 1e-7);
}

TEST(Worm, FrictionTakesItsShareAndLocks) {
  // T = F r tan(l + phi) drives the wheel against F; with mu = tan phi above tan l the wheel cannot drive the worm.
  const double tangent = 0.06 / (2 * kPi * 0.05), mu = 0.3;
  ASSERT_GT(mu, tangent);
  const std::string friction = "friction = { coefficient = 0.3, slip_speed = 1e-5 }";
  const Simulation s = simulated(worm_drive(
      friction,
      "[joints.motor]\ntype = \"rotation-motor\"\nbodies = [\"ground\", \"worm\"]\nat = [0, 0, 0]\naxis = [1, "
      "0, 0]\nmotion = \"40 * t\"\n[forces.back]\ntype = \"load\"\na = { body = \"wheel\" }\nmoment = [0, -5, "
      "0]\n[initial]\nvelocities = \"project\"\n" +
          kAccurate + "end = 0.5\n"));
  EXPECT_NEAR(s.value("motor.moment.x"), 25 * 0.05 * std::tan(std::atan(tangent) + std::atan(mu)), 1e-6);
  const Simulation locked =
      simulated(worm_drive(friction, "[forces.back]\ntype = \"load\"\na = { body = \"wheel\" }\nmoment = [0, -5, 0]\n" +
                                         kAccurate + "end = 1\n"));
  EXPECT_LT(std::abs(locked.value("wheel-bearing.angle")), 1e-3);
  const Simulation slips = simulated(worm_drive(
      "friction = { coefficient = 0.1, slip_speed = 1e-4 }",
      "[forces.back]\ntype = \"load\"\na = { body = \"wheel\" }\nmoment = [0, -5, 0]\n" + kAccurate + "end = 1\n"));
  // With mu = 0.1 it does: F r_w tan(l - phi) turns the worm, 5 - F R the wheel; angle at t = 1.
  const double back = 0.05 * std::tan(std::atan(tangent) - std::atan(0.1)) / 0.01 * 0.06 / (2 * kPi * 0.2);
  EXPECT_NEAR(slips.value("wheel-bearing.angle"), -0.5 * back * 5 / (0.2 + 0.3 * back), 2e-4);
}

TEST(CableJoint, AtwoodsMachineAndATackle) {
  for (const double scale : {1e-3, 1.0, 1e3}) {
    const auto mass = [&](const std::string& name, double m, double x) {
      return fmt::format("[bodies.{}]\ntype = \"point\"\nmass = {}\nposition = [{}, 0, {}]\n", name, m, x * scale,
                         -scale);
    };
    const std::string end = fmt::format("[integrator]\nrelative = 1e-9\nabsolute = {}\nend = 0.5\n", 1e-11 * scale);
    const std::string gravity = fmt::format("gravity = [0, 0, {}]\n", -10 * scale);
    // Through one ring: a = g (5 - 3) / 8, tension 2 * 5 * 3 g / 8.
    const Simulation s =
        simulated(gravity + mass("heavy", 5, 0) + mass("light", 3, 0) +
                  "[joints.rope]\ntype = \"cable\"\nthrough = [\"heavy\", { body = \"ground\" }, \"light\"]\n" + end);
    EXPECT_NEAR(s.value("heavy.position.z"), (-1 - 0.125 * 2.5) * scale, 1e-8 * scale);
    EXPECT_NEAR(s.value("light.position.z"), (-1 + 0.125 * 2.5) * scale, 1e-8 * scale);
    EXPECT_NEAR(s.value("rope.tension"), 37.5 * scale, 1e-7 * scale);
    EXPECT_NEAR(s.value("rope.coordinate"), -s.value("heavy.position.z"), 1e-9 * scale);
    // A loose pulley in the bight: m_1 g - T = m_1 a, 2 T - m_2 g = m_2 a / 2.
    const Simulation tackle = simulated(
        gravity + mass("end", 5, 2) + mass("pulley", 3, 1) +
        fmt::format(
            "[joints.rope]\ntype = \"cable\"\nthrough = [{{ body = \"ground\", point = [{0}, 0, 0] }}, \"pulley\", "
            "{{ body = \"ground\", point = [{0}, 0, 0] }}, {{ body = \"ground\", point = [{1}, 0, 0] }}, \"end\"]\n",
            scale, 2 * scale) +
        end);
    const double a = (5 - 1.5) * 10 / (5 + 0.75);
    EXPECT_NEAR(tackle.value("end.position.z"), (-1 - a * 0.125) * scale, 1e-7 * scale);
    EXPECT_NEAR(tackle.value("pulley.position.z"), (-1 + a * 0.0625) * scale, 1e-7 * scale);
    EXPECT_NEAR(tackle.value("rope.tension"), 5 * (10 - a) * scale, 1e-6 * scale);
  }
}

TEST(CableForce, StretchesAndGoesSlack) {
  // A mass of 2 thrown up on a cable of 1 over a ring: slack until it falls back, then it swings as on a spring.
  const std::string model =
      "gravity = [0, 0, -10]\n[bodies.bob]\ntype = \"point\"\nmass = 2\nposition = [0, 0, -0.6]\nvelocity = [0, 0, 2]\n"
      "[forces.rope]\ntype = \"cable\"\nthrough = [{ body = \"ground\", point = [0.4, 0, 0] }, { body = \"ground\" }, "
      "\"bob\"]\nstiffness = 800\nlength = 1\n";
  const Simulation slack = simulated(model + kAccurate + "end = 0.3\n");
  EXPECT_NEAR(slack.value("bob.position.z"), -0.6 + 0.6 - 0.45, 1e-8);
  EXPECT_EQ(slack.value("rope.tension"), 0);
  EXPECT_NEAR(slack.value("rope.length"), 0.85, 1e-8);
  // Taut at t = 0.4 with 2 downwards: about the rest, 20 / 800 below, with the frequency 20.
  const Simulation taut = simulated(model + kAccurate + "end = 0.45\n");
  const double phase = 20 * 0.05, z = -0.6 - 0.025 + 0.025 * std::cos(phase) - 2.0 / 20 * std::sin(phase);
  EXPECT_NEAR(taut.value("bob.position.z"), z, 1e-6);
  EXPECT_NEAR(taut.value("rope.tension"), 800 * (-0.6 - z), 1e-3);
  EXPECT_NEAR(taut.value("energy.total"), slack.value("energy.total"), 1e-6);
  // At rest, by statics, with the stretch of both ends.
  const Simulation rest = simulated(replaced(model, "velocity = [0, 0, 2]\n", "velocity = [0, 0, 0]\n") +
                                    "[joints.up]\ntype = \"in-line\"\na = { body = \"ground\", axis = [0, 0, 1] }\nb = "
                                    "{ body = \"bob\" }\n[statics]\n");
  EXPECT_NEAR(rest.value("bob.position.z"), -0.625, 1e-9);
  EXPECT_NEAR(rest.value("rope.first_tension"), 20, 1e-6);
}

TEST(CableForce, RubsInItsRings) {
  // A mass of 3 is pulled up over a ring: T = m g exp(mu turn); let down: m g exp(-mu turn). Over two rings it turns by
  // a quarter in each.
  for (const int side : {1, -1})
    for (const bool two : {false, true}) {
      const double wide = two ? 0.4 : 0.3;
      const std::string rings = two ? "{ body = \"ground\" }, { body = \"ground\", point = [0.4, 0, 0] }"
                                    : std::string("{ body = \"ground\" }");
      const Simulation s = simulated(fmt::format(
          "gravity = [0, 0, -10]\n[bodies.load]\ntype = \"point\"\nmass = 3\nposition = [0, 0, -1]\nvelocity = [0, 0, "
          "{0}]\n[bodies.hand]\ntype = \"point\"\nmass = 1\nposition = [{1}, 0, -1]\nvelocity = [0, 0, {2}]\n"
          "[joints.rail]\ntype = \"in-line\"\na = {{ body = \"ground\", axis = [0, 0, 1], point = [{1}, 0, 0] }}\nb = "
          "{{ "
          "body = \"hand\" }}\n[joints.pull]\ntype = \"translation-motor\"\na = {{ body = \"ground\", axis = [0, 0, 1] "
          "}}\nb = {{ body = \"hand\" }}\nmotion = \"{2} * t - 1\"\n[joints.plumb]\ntype = \"in-line\"\na = {{ body = "
          "\"ground\", axis = [0, 0, 1] }}\nb = {{ body = \"load\" }}\n[forces.rope]\ntype = \"cable\"\nthrough = "
          "[\"load\", {3}, \"hand\"]\nstiffness = 1e5\ndamping = 1e3\nlength = {4:.17g}\nfriction = 0.2\nslip_speed = "
          "1e-3\n[integrator]\nrelative = 1e-7\nabsolute = 1e-9\nend = 2\n",
          0.2 * side, wide, -0.2 * side, rings, (two ? 2.4 : 1 + std::hypot(0.3, 1)) - 3e-4));
      EXPECT_NEAR(s.value("rope.first_tension"), 30, two ? 5e-3 : 0.1);  // it is not quite steady
      const double turn = two ? kPi : kPi - std::atan2(0.3, -s.value("hand.position.z"));
      EXPECT_NEAR(s.value("rope.tension") / s.value("rope.first_tension"), std::exp(0.2 * turn * side), 1e-4);
      const double speed = two ? 0.2 : 0.2 * std::cos(std::atan2(0.3, -s.value("hand.position.z")));
      EXPECT_NEAR(s.value("load.velocity.z"), speed * side, 2e-3);
    }
}

TEST(Wheels, MistakesAreNamed) {
  const auto says = [](const std::string& text) -> std::string {
    Simulation s;
    const Status status = s.load_text(text, "model.toml");
    return status.ok() ? "" : status.message;
  };
  const auto expect = [&](const std::string& text, const std::string& words) {
    EXPECT_NE(says(text).find(words), std::string::npos) << says(text);
  };
  const std::string two =
      wheel("one", 1, 1, "") + wheel("two", 1, 1, "position = [1, 0, 0]") + "[integrator]\nend = 1\n";
  const std::string pair = "a = { body = \"one\", axis = [0, 0, 1] }\nb = { body = \"two\" }\n";
  const std::string crossed = "a = { body = \"one\", axis = [0, 0, 1] }\nb = { body = \"two\", axis = [1, 0, 0] }\n";
  expect(two + "[joints.j]\ntype = \"gear-pair\"\n" + pair, "teeth");
  expect(two + "[joints.j]\ntype = \"gear-pair\"\nteeth = [1, -2]\n" + pair, "greater than 0");
  expect(two + "[joints.j]\ntype = \"gear-pair\"\nteeth = [20, 10]\ninner = \"b\"\n" + pair, "must have more of them");
  expect(two + "[joints.j]\ntype = \"gear-pair\"\nteeth = [20, 10]\n" + crossed, "must be parallel");
  expect(two +
             "[joints.j]\ntype = \"gear-pair\"\nteeth = [20, 10]\nbodies = [\"one\", \"two\"]\nat = [0, 0, 0]\naxis = "
             "[0, 0, 1]\n",
         "on one axis");
  expect(two + "[joints.j]\ntype = \"rack-pair\"\n" + pair, "needs an axis of its own in frame 'b'");
  expect(two +
             "[joints.j]\ntype = \"rack-pair\"\na = { body = \"one\", axis = [0, 0, 1] }\nb = { body = \"two\", axis "
             "= [0, 1, 1] }\n",
         "perpendicular");
  expect(two + "[joints.j]\ntype = \"rack-pair\"\n" + crossed, "beside it");
  expect(two +
             "[joints.j]\ntype = \"worm\"\nlead = 1\nradius = 2\na = { body = \"one\", axis = [0, 0, 1] }\nb = { body "
             "= \"two\", axis = [0, 1, 0] }\n",
         "must be less than the distance");
  expect(two + "[joints.j]\ntype = \"worm\"\nlead = 0\nradius = 2\n" + crossed, "must not be 0");
  expect(two + "[joints.j]\ntype = \"screw\"\nlead = 0\n" + pair, "must not be 0");
  expect(two + "[joints.j]\ntype = \"cable\"\nthrough = [\"one\"]\n", "a list of 2 to 12 frames");
  expect(two + "[joints.j]\ntype = \"cable\"\n" + pair, "through");
  expect(two + "[joints.j]\ntype = \"cable\"\nthrough = [\"one\", \"twoo\"]\n", "two");
  expect(two + "[joints.j]\ntype = \"in-plane\"\nlimits = { upper = 1, stiffness = 1, smoothing = 1 }\n" + pair,
         "have limits");
  expect(two +
             "[joints.j]\ntype = \"constant-velocity\"\na = { body = \"one\", axis = [0, 0, 1] }\nb = { body = "
             "\"two\", axis = [0, 0, -1] }\n",
         "point against each other");
  expect(two + "[joints.j]\ntype = \"point-on-curve\"\npoints = [[0, 0, 0], [1, 0, 0]]\n" + pair,
         "an open curve has ends");
  expect(two + "[joints.j]\ntype = \"point-on-curve\"\nends = \"straight\"\n" + pair, "either 'points' or 'file'");
  expect(two + "[joints.j]\ntype = \"point-on-curve\"\nfile = \"nowhere.csv\"\nends = \"straight\"\n" + pair,
         "nowhere.csv");
  expect(
      two + "[joints.j]\ntype = \"point-on-curve\"\nclosed = true\npoints = [[0, 0, 0], [1, 0, 0], [1, 0, 0]]\n" + pair,
      "points 2 and 3");
  expect(two +
             "[joints.j]\ntype = \"point-on-curve\"\nends = \"straight\"\nmotion = \"t\"\nfriction = { viscous = 1 }\n"
             "points = [[0, 0, 0], [1, 0, 0]]\n" +
             pair,
         "led by 'motion'");
  expect(two +
             "[joints.j]\ntype = \"point-on-surface\"\nshape = \"heights\"\nx = [0, 1]\ny = [0, 0]\nheights = [[0, 0], "
             "[0, 0]]\n" +
             pair,
         "each greater");
  expect(two +
             "[joints.j]\ntype = \"point-on-surface\"\nshape = \"heights\"\nx = [0, 1]\ny = [0, 1]\nheights = [[0, "
             "0], [0]]\n" +
             pair,
         "a list of rows");
  expect(two + "[joints.j]\ntype = \"point-on-surface\"\nshape = \"torus\"\nradius = 1\nrim = 1\n" + pair, "less than");
  expect(two + "[joints.j]\ntype = \"point-on-surface\"\nshape = \"sphere\"\nradius = -1\n" + pair, "greater than 0");
}

}  // namespace joint_wheels_test
}  // namespace espalier::dynamics

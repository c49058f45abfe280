// Screws, constant-velocity joints, points on curves and surfaces, wheels with axes that move, cables. Truth: closed
// forms of their motions and reactions; other joints that lead to the same motion.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "dynamics/model/model_common.hpp"
#include "espalier/sensitivities.hpp"

namespace espalier::dynamics {
namespace joint_closed_forms_test {

constexpr double kPi = std::numbers::pi;
const std::string kFine = "[integrator]\nrelative = 1e-9\nabsolute = 1e-11\n";

std::string rigid(const std::string& name, const std::string& more) {
  return "[bodies." + name + "]\ntype = \"rigid\"\nmass = 2\ninertia = [0.3, 0.4, 0.5]\n" + more + "\n";
}

TEST(Screw, FallsOnAndTurns) {
  // (m (p / 2 pi)^2 + J) theta'' = -m g p / 2 pi, at every scale.
  for (const double scale : {1e-3, 1.0, 1e3}) {
    const double lead = 0.7 * scale, step = lead / (2 * kPi), inertia = 0.5 * scale * scale, g = 10 * scale;
    const std::string model = fmt::format(
        "gravity = [0, 0, {}]\n[bodies.nut]\ntype = \"rigid\"\nmass = 2\ninertia = [{}, {}, {}]\n[joints.thread]\ntype "
        "= \"screw\"\nbodies = [\"ground\", \"nut\"]\nat = [0, 0, 0]\naxis = [0, 0, 1]\nlead = {}\n",
        -g, inertia, inertia, inertia, lead);
    const double alpha = -2 * g * step / (2 * step * step + inertia);
    const Simulation s =
        simulated(model + fmt::format("[integrator]\nrelative = 1e-9\nabsolute = {}\nend = 3\n", 1e-11 * scale));
    const double angle = alpha * 4.5;  // some turns
    ASSERT_GT(std::abs(angle), 5 * kPi);
    EXPECT_NEAR(s.value("thread.angle"), angle, 1e-6 * std::abs(angle));
    EXPECT_NEAR(s.value("thread.angular_speed"), 3 * alpha, 1e-6 * std::abs(angle));
    EXPECT_NEAR(s.value("thread.displacement"), step * angle, 1e-6 * std::abs(angle) * scale);
    EXPECT_NEAR(s.value("nut.position.z"), step * angle, 1e-6 * std::abs(angle) * scale);
    // The thread holds up what does not fall, and turns what turns.
    EXPECT_NEAR(s.value("thread.force.z"), 2 * (g + step * alpha), 1e-6 * g);
    EXPECT_NEAR(s.value("thread.moment.z"), inertia * alpha, 1e-6 * g * scale);
    EXPECT_EQ(s.summary().degrees_of_freedom, 1);
  }
}

TEST(Screw, ThreadFrictionIsThatOfASquareThread) {
  // To raise W = 20 it takes T = W r (tan l + mu) / (1 - mu tan l); to lower it W r (mu - tan l) / (1 + mu tan l).
  const double radius = 0.05, lead = 0.04, mu = 0.12, tangent = lead / (2 * kPi * radius);
  const auto torque = [&](double speed) {
    const Simulation s = simulated(fmt::format(
        "gravity = [0, 0, -10]\n{}[joints.thread]\ntype = \"screw\"\nbodies = [\"ground\", \"nut\"]\nat = [0, 0, 0]\n"
        "axis = [0, 0, 1]\nlead = {}\nfriction = {{ coefficient = {}, slip_speed = 1e-5, radius = {} }}\n"
        "[joints.turn]\ntype = \"rotation-motor\"\nbodies = [\"ground\", \"nut\"]\nat = [0, 0, 0]\naxis = [0, 0, 1]\n"
        "motion = \"{} * t\"\n{}end = 1\n",
        rigid("nut", fmt::format("velocity = [0, 0, {:.17g}]\nangular_velocity = [0, 0, {}]", speed * lead / (2 * kPi),
                                 speed)),
        lead, mu, radius, speed, kFine));
    EXPECT_NEAR(s.value("thread.displacement"), speed * lead / (2 * kPi), 1e-9);
    return s.value("turn.moment.z");
  };
  EXPECT_NEAR(torque(2), 20 * radius * (tangent + mu) / (1 - mu * tangent), 1e-7);
  EXPECT_NEAR(torque(-2), -20 * radius * (mu - tangent) / (1 + mu * tangent), 1e-7);
}

TEST(Screw, StopsAtItsLimitsAndIsSwitched) {
  const std::string model = "gravity = [0, 0, -10]\n" + rigid("nut", "") +
                            "[joints.thread]\ntype = \"screw\"\nbodies = [\"ground\", \"nut\"]\nat = [0, 0, 0]\naxis = "
                            "[0, 0, 1]\nlead = 0.5\n";
  const Simulation s = simulated(model + "limits = { lower = -0.2, stiffness = 1e5, smoothing = 1e-6, damping = 5 }\n" +
                                 "friction = { viscous = 30 }\n[integrator]\nend = 20\n");
  EXPECT_NEAR(s.value("thread.displacement"), -0.2, 1e-3);
  EXPECT_NEAR(s.value("thread.stop_force"), -20, 1e-3);
  // Off in the fall, on again: the nut keeps the offset that it then has.
  const Simulation off =
      simulated(model + "active = false\n[events.catch]\nwhen = \"t > 0.2\"\nonce = true\non = [\"thread\"]\n" + kFine +
                "end = 0.5\n");
  const double step = 0.5 / (2 * kPi), fallen = 0.2;
  EXPECT_NEAR((off.value("nut.position.z") + fallen) / step, off.value("thread.angle"), 1e-7);
  EXPECT_LT(off.value("thread.angle"), -0.1);
}

/// Two shafts at an angle; the first led at a speed of 3, the second with a torque against it.
std::string bent_shafts(const std::string& joint, double bend, double torque) {
  const double s = std::sin(bend), c = std::cos(bend);
  const std::string along = fmt::format("axis = [{:.17g}, 0, {:.17g}]", s, c);
  const std::string phase =
      joint == "universal" ? fmt::format("[{:.17g}, 0, {:.17g}]", c, -s) : std::string("[0.3, 0.8, 0.1]");
  return rigid("one", "position = [0, 0, -1]\nangular_velocity = [0, 0, 3]") +
         fmt::format(
             "[bodies.two]\ntype = \"rigid\"\nmass = 2\ninertia = [0.5, 0.5, 0.5]\nposition = [{:.17g}, 0, "
             "{:.17g}]\n",
             s, c) +
         "[joints.bearing]\ntype = \"rotation-motor\"\nbodies = [\"ground\", \"one\"]\nat = [0, 0, -1]\naxis = [0, "
         "0, 1]\nmotion = \"3 * t\"\n[joints.shaft]\ntype = \"revolute\"\nbodies = [\"ground\", \"one\"]\nat = [0, "
         "0, -1]\naxis = [0, 0, 1]\n[joints.bend]\ntype = \"" +
         joint + "\"\na = { body = \"one\", axis = [0, 0, 1], point = [0, 0, 1] }\nb = { body = \"two\", " + along +
         ", x_axis = " + phase + fmt::format(", point = [{:.17g}, 0, {:.17g}] }}\n", -s, -c) +
         "[joints.guide]\ntype = \"in-line\"\na = { body = \"ground\", " + along +
         " }\nb = { body = \"two\" }\n[forces.load]\ntype = \"load\"\na = { body = \"two\" }\n" +
         fmt::format("moment = [{:.17g}, 0, {:.17g}]\n", -torque * s, -torque * c);
}

TEST(ConstantVelocity, UniversalJointsFluctuateBesideIt) {
  // w_2 / w_1 = cos b / (1 - sin^2 b cos^2 phi), phi the turn of the first shaft from where its cross axis lies in the
  // plane of the shafts.
  const double bend = 0.9, c = std::cos(bend), s2 = std::pow(std::sin(bend), 2);
  for (const double end : {0.2, 0.5, 1.1}) {
    const Simulation s = simulated(bent_shafts("universal", bend, 0) + "[initial]\nvelocities = \"project\"\n" + kFine +
                                   fmt::format("end = {}\n", end));
    const double speed =
        s.value("two.angular_velocity.x") * std::sin(bend) + s.value("two.angular_velocity.z") * std::cos(bend);
    EXPECT_NEAR(speed, 3 * c / (1 - s2 * std::pow(std::cos(3 * end), 2)), 1e-5);
  }
}

TEST(ConstantVelocity, BothShaftsTurnAtOneSpeedAtAnyBend) {
  for (const double bend : {0.0, 0.3, 0.9, 1.4}) {
    const std::string model = bent_shafts("constant-velocity", bend, 7) + "[initial]\nvelocities = \"project\"\n";
    for (const double end : {0.3, 1.0, 5.0}) {
      const Simulation s = simulated(model + kFine + fmt::format("end = {}\n", end));
      const double speed =
          s.value("two.angular_velocity.x") * std::sin(bend) + s.value("two.angular_velocity.z") * std::cos(bend);
      EXPECT_NEAR(speed, 3, 1e-6) << bend;
      EXPECT_NEAR(s.value("bend.bend_angle"), bend, 1e-6);
      EXPECT_NEAR(s.value("bearing.moment.z"), 7, 1e-5);  // what goes in comes out
      // The joint's moment lies along the sum of the shafts: 7 about the second, and so about the first.
      const double along = 7 / std::cos(bend / 2);
      EXPECT_NEAR(s.value("bend.moment.norm"), along, 1e-5);
      EXPECT_NEAR(s.value("bend.moment.z"), along * std::cos(bend / 2), 1e-5);
      EXPECT_EQ(s.summary().degrees_of_freedom, 0);
      EXPECT_TRUE(s.summary().redundant.empty());
    }
  }
}

TEST(ConstantVelocity, BendsFreelyUpToItsLimit) {
  // A pendulum on such a joint swings as on a spherical one until the stop holds it: 20 * 0.5 * sin(bend) about it.
  const std::string model =
      "gravity = [10, 0, 0]\n" + rigid("bob", "position = [0, 0, 0.5]") +
      "[joints.ball]\ntype = \"constant-velocity\"\nbodies = [\"ground\", \"bob\"]\nat = [0, 0, 0]\naxis = [0, 0, 1]\n";
  const Simulation s = simulated(
      model +
      "limits = { upper = 0.4, stiffness = 1e4, smoothing = 1e-4, damping = 1 }\n[forces.brake]\ntype = "
      "\"bushing\"\nbodies = [\"ground\", \"bob\"]\nat = [0, 0, 0]\nangular_damping = [3, 3, 3]\n[integrator]\nend "
      "= 20\n");
  EXPECT_NEAR(s.value("ball.bend_angle"), 0.4, 2e-3);
  EXPECT_NEAR(s.value("ball.stop_moment"), 20 * 0.5 * std::cos(s.value("ball.bend_angle")), 1e-3);
}

TEST(ParallelAxes, BodyKeepsItsTilt) {
  const Simulation s =
      simulated("gravity = [0, 0, -10]\n" +
                rigid("b", "position = [1, 2, 3]\nvelocity = [1, 0, 0]\nangular_velocity = [0, 0, 4]") +
                "[joints.tilt]\ntype = \"parallel-axes\"\nbodies = [\"ground\", \"b\"]\nat = [0, 0, "
                "0]\naxis = [0, 0, 1]\nfriction = { viscous = 0.25 }\n[forces.tip]\ntype = \"load\"\na = { body = "
                "\"b\" }\nmoment = [3, -2, 0]\n" +
                kFine + "end = 2\n");
  EXPECT_EQ(s.summary().degrees_of_freedom, 4);
  EXPECT_NEAR(s.value("b.position.x"), 3, 1e-7);
  EXPECT_NEAR(s.value("b.position.z"), 3 - 20, 1e-6);
  EXPECT_NEAR(s.value("tilt.angular_speed"), 4 * std::exp(-1.0), 1e-6);  // J w' = -c w
  EXPECT_NEAR(s.value("tilt.angle"), 8 * (1 - std::exp(-1.0)), 1e-6);
  EXPECT_NEAR(s.value("tilt.moment.x"), -3, 1e-6);
  EXPECT_NEAR(s.value("tilt.moment.y"), 2, 1e-6);
}

TEST(InLine, BodySlidesAndTurnsOnItsLine) {
  // a = g (sin - mu cos) down a slope of tangent 3/4, at the end on a stop.
  const std::string model =
      "gravity = [0, 0, -10]\n" + rigid("b", "angular_velocity = [1, 2, 3]") +
      "[joints.wire]\ntype = \"in-line\"\na = { body = \"ground\", axis = [0.8, 0, -0.6] }\nb = { body = \"b\" }\n";
  const Simulation s =
      simulated(model + "friction = { coefficient = 0.25, slip_speed = 1e-5 }\n" + kFine + "end = 1\n");
  EXPECT_NEAR(s.value("wire.speed"), 6 - 0.25 * 8, 1e-4);
  EXPECT_NEAR(s.value("wire.friction_force"), 0.25 * 16, 1e-6);
  EXPECT_NEAR(s.value("wire.force.norm"), 16, 1e-6);
  const Simulation stopped = simulated(replaced(model, "in-line", "point-on-line") +
                                       "friction = { viscous = 20 }\nlimits = { upper = 0.5, stiffness = 1e5, "
                                       "smoothing = 1e-6 }\n[integrator]\nend = 20\n");
  EXPECT_NEAR(stopped.value("wire.displacement"), 0.5, 1e-3);
  EXPECT_NEAR(stopped.value("wire.stop_force"), 12, 1e-3);
}

TEST(InPlane, BodySlidesOnItsPlaneInAnyDirection) {
  // Thrown across the slope x: the speed along it turns towards the slope; friction is against it, mu m g cos.
  const std::string model =
      "gravity = [6, 0, -8]\n" + rigid("b", "velocity = [0, 1, 0]\nangular_velocity = [1, 2, 3]") +
      "[joints.plane]\ntype = \"in-plane\"\nbodies = [\"ground\", \"b\"]\nat = [0, 0, 0]\naxis = [0, 0, 1]\n";
  const Simulation rough =
      simulated(model + "friction = { coefficient = 0.75, slip_speed = 1e-4 }\n" + kFine + "end = 4\n");
  // With mu = tan of the slope v + v_x stays: v_x goes to v_0 / 2 (the motion of a body on such a slope, Galilei's
  // turn).
  EXPECT_NEAR(rough.value("plane.speed_x"), 0.5, 2e-4);
  EXPECT_NEAR(rough.value("plane.speed_y"), 0, 2e-4);
  EXPECT_NEAR(rough.value("plane.friction_force"), 12, 2e-3);
  EXPECT_NEAR(rough.value("plane.force.z"), 16, 1e-6);
  const Simulation smooth = simulated(model + kFine + "end = 1\n");
  EXPECT_NEAR(smooth.value("plane.displacement_x"), 3, 1e-7);
  EXPECT_NEAR(smooth.value("plane.displacement_y"), 1, 1e-7);
  EXPECT_EQ(smooth.summary().degrees_of_freedom, 5);
}

/// Points u of a function of three texts, as a list for a model.
template <class F>
std::string points_of(const F& f, int count, double from, double to) {
  std::string text = "[";
  for (int k = 0; k < count; ++k) {
    const auto [x, y, z] = f(from + (to - from) * k / (count - 1));
    text += fmt::format("{}[{:.17g}, {:.17g}, {:.17g}]", k == 0 ? "" : ", ", x, y, z);
  }
  return text + "]";
}

struct Place3 {
  double x, y, z;
};

/// A circle about y, its lowest point the first and the last.
std::string circle(double radius, int count) {
  return points_of(
      [&](double u) {
        return Place3{radius * std::sin(u), 0, -radius * std::cos(u)};
      },
      count + 1, 0, 2 * kPi);
}

TEST(PointOnCurve, BeadOnACircleIsAPendulum) {
  for (const double scale : {1e-3, 1.0, 1e3}) {
    // Thrown so that it goes round and round; beside a link of the same length.
    const double speed = 2.2 * std::sqrt(10) * scale;
    const std::string bead = fmt::format(
        "gravity = [0, 0, {}]\n[bodies.bead]\ntype = \"point\"\nmass = 2\nposition = [0, 0, {}]\nvelocity = [{}, 0, "
        "0]\n",
        -10 * scale, -scale, speed);
    const std::string run = fmt::format("[integrator]\nrelative = 1e-8\nabsolute = {}\nend = 3\n", 1e-10 * scale);
    const Simulation s = simulated(
        bead +
        "[joints.wire]\ntype = \"point-on-curve\"\na = { body = \"ground\" }\nb = { body = \"bead\" }\nclosed = "
        "true\npoints = " +
        circle(scale, 240) + "\n" + run);
    const Simulation link = simulated(
        bead +
        "[joints.link]\ntype = \"distance\"\na = { body = \"ground\" }\nb = { body = \"bead\" }\n[joints.flat]\ntype "
        "= \"in-plane\"\na = { body = \"ground\", axis = [0, 1, 0] }\nb = { body = \"bead\" }\n" +
        run);
    EXPECT_NEAR(s.value("bead.position.x"), link.value("bead.position.x"), 2e-5 * scale);
    EXPECT_NEAR(s.value("bead.position.z"), link.value("bead.position.z"), 2e-5 * scale);
    EXPECT_NEAR(s.value("wire.force.norm"), link.value("link.force.norm"), 1e-3 * scale);  // twice differentiated: h^2
    EXPECT_GT(s.value("wire.displacement"), 4 * kPi * scale);                              // rounds are counted
    EXPECT_EQ(s.summary().degrees_of_freedom, 1);
    EXPECT_TRUE(s.summary().redundant.empty());
  }
}

TEST(PointOnCurve, BeadOnAHelix) {
  // a = g sin; the curvature radius / (radius^2 + step^2) turns it: N^2 = (m g cos)^2 + (m v^2 k)^2.
  const double radius = 0.5, step = 0.2, length = std::hypot(radius, step), sine = step / length;
  const std::string model =
      "gravity = [0, 0, -10]\n" + rigid("bead", "position = [0.5, 0, 0]\nangular_velocity = [1, 0, 2]") +
      "[joints.wire]\ntype = \"point-on-curve\"\na = { body = \"ground\" }\nb = { body = \"bead\" }\nends = "
      "\"straight\"\npoints = " +
      points_of(
          [&](double u) {
            return Place3{radius * std::cos(u), radius * std::sin(u), -step * u};
          },
          961, 0, 20) +
      "\n";
  const Simulation s = simulated(model + kFine + "end = 1.5\n");
  const double v = 10 * sine * 1.5;
  EXPECT_NEAR(s.value("wire.speed"), v, 1e-5);
  EXPECT_NEAR(s.value("wire.displacement"), v * 1.5 / 2, 1e-5);
  EXPECT_NEAR(s.value("wire.force.norm"),
              std::hypot(20 * std::cos(std::asin(sine)), 2 * v * v * radius / (length * length)), 1e-2);
  EXPECT_NEAR(s.value("energy.total"), simulated(model + kFine + "end = 0.01\n").value("energy.total"), 2e-5);
  EXPECT_LT(s.summary().largest_violation.position, 1e-9);
}

TEST(PointOnCurve, EndsAreStopsOrPassedOrLeft) {
  // A straight wire of 2.5 down a slope of tangent 3/4: 6 along it.
  const std::string model =
      "gravity = [0, 0, -10]\n[bodies.bead]\ntype = \"point\"\nmass = 2\n[joints.wire]\ntype = \"point-on-curve\"\na = "
      "{ "
      "body = \"ground\" }\nb = { body = \"bead\" }\npoints = [[0, 0, 0], [2, 0, -1.5]]\n";
  const Simulation stopped = simulated(
      model + "limits = { stiffness = 1e5, smoothing = 1e-6 }\nfriction = { viscous = 30 }\n" + kFine + "end = 15\n");
  EXPECT_NEAR(stopped.value("wire.displacement"), 2.5, 1e-3);
  EXPECT_NEAR(stopped.value("wire.stop_force"), 12, 1e-3);
  const Simulation passed = simulated(model + "ends = \"straight\"\n" + kFine + "end = 2\n");
  EXPECT_NEAR(passed.value("wire.displacement"), 12, 1e-6);
  EXPECT_NEAR(passed.value("bead.position.z"), -12 * 0.6, 1e-6);
  // Left at the end, with sqrt(2 * 6 * 2.5) along the slope, at t = v / 6; then it falls freely.
  const Simulation left = simulated(
      model + "ends = \"straight\"\n[events.end]\nwhen = \"wire.displacement > 2.5\"\noff = [\"wire\"]\nonce = true\n" +
      kFine + "end = 1.5\n");
  const double v = std::sqrt(30), fall = 1.5 - v / 6;
  EXPECT_NEAR(left.value("bead.position.x"), 2 + 0.8 * v * fall, 1e-5);
  EXPECT_NEAR(left.value("bead.position.z"), -1.5 - 0.6 * v * fall - 5 * fall * fall, 1e-5);
}

TEST(PointOnCurve, LeavesALoopInMidRun) {
  // Up a circle of radius 1 from below with v^2 = 40: off at the height of the centre, with 20 upwards; it then falls
  // through the middle of what it has left.
  const Simulation s = simulated(
      "gravity = [-1, 0, -10]\n[bodies.bead]\ntype = \"point\"\nmass = 2\nposition = [0, 0, -1]\nvelocity = [" +
      fmt::format("{:.17g}", std::sqrt(40)) +
      ", 0, 0]\n[joints.wire]\ntype = \"point-on-curve\"\na = { body = \"ground\" }\nb = { body = \"bead\" }\nclosed = "
      "true\npoints = " +
      circle(1, 120) +
      "\n[events.off]\nwhen = \"bead.position.z > 0\"\noff = [\"wire\"]\nonce = "
      "true\n" +
      kFine + "end = 2.5\n[output]\nquantities = [\"wire.displacement\"]\n");
  ASSERT_EQ(s.summary().events.size(), 1U);
  const double fall = 2.5 - s.summary().events[0].t, v = std::sqrt(40 - 2 * 10 - 2);
  EXPECT_NEAR(s.value("bead.position.x"), 1 - fall * fall / 2, 1e-4);
  EXPECT_NEAR(s.value("bead.position.z"), v * fall - 5 * fall * fall, 1e-4);
}

TEST(PointOnCurve, RubsAndIsLed) {
  const std::string model =
      "gravity = [0, 0, -10]\n[bodies.bead]\ntype = \"point\"\nmass = 2\n[joints.wire]\ntype = \"point-on-curve\"\na = "
      "{ "
      "body = \"ground\" }\nb = { body = \"bead\" }\nends = \"straight\"\npoints = [[0, 0, 0], [2, 0, -1.5]]\n";
  const Simulation rough =
      simulated(model + "friction = { coefficient = 0.25, slip_speed = 1e-5 }\n" + kFine + "end = 1\n");
  EXPECT_NEAR(rough.value("wire.speed"), 4, 1e-4);
  EXPECT_NEAR(rough.value("wire.friction_force"), 4, 1e-6);
  // Led by t^2 / 2 along the wire: the lead holds m (g sin - 1) back, the wire m g cos.
  const Simulation led = simulated(model + "motion = \"t^2/2\"\n" + kFine + "end = 2\n");
  EXPECT_NEAR(led.value("wire.displacement"), 2, 1e-8);
  EXPECT_NEAR(led.value("wire.force.x"), 2 * 0.8, 1e-6);
  EXPECT_NEAR(led.value("wire.force.z"), 20 - 2 * 0.6, 1e-6);
  EXPECT_EQ(led.summary().degrees_of_freedom, 0);
}

TEST(PointOnCurve, CurvesRideOnBodiesAndFlexibleOnesRideOnThem) {
  // The wire on a cart, both free: the centre of mass stays, and energy does.
  const std::string model =
      "gravity = [0, 0, -10]\n" + rigid("cart", "") +
      "[joints.rail]\ntype = \"prismatic\"\nbodies = [\"ground\", \"cart\"]\nat = [0, 0, 0]\naxis = [1, 0, 0]\n"
      "[bodies.bead]\ntype = \"point\"\nmass = 3\nposition = [0, 0, 1]\n[markers.place]\nbody = \"cart\"\npoint = [0, "
      "0, 1]\n[joints.wire]\ntype = \"point-on-curve\"\na = \"place\"\nb = \"bead\"\nends = \"straight\"\npoints = " +
      points_of(
          [](double u) {
            return Place3{u, 0, -0.25 * u * u - 0.1 * u};
          },
          241, -2, 4) +
      "\n";
  const Simulation s = simulated(model + kFine + "end = 0.8\n");
  EXPECT_NEAR(2 * s.value("cart.position.x") + 3 * s.value("bead.position.x"), 0, 1e-6);
  const double u = s.value("bead.position.x") - s.value("cart.position.x");
  EXPECT_GT(u, 0.1);
  EXPECT_NEAR(s.value("bead.position.z"), 1 - 0.25 * u * u - 0.1 * u, 1e-6);
  EXPECT_NEAR(s.value("energy.kinetic"), 30 * (1 - s.value("bead.position.z")), 1e-5);
  // The tip of a beam in an inclined slot, which bears on it squarely; the clamp takes the rest.
  const Simulation tip = simulated(
      "[bodies.rod]\ntype = \"beam\"\nstart = [0, 0, 0]\nend = [1, 0, 0]\nelements = 4\nradius = 0.02\nmaterial = { "
      "young "
      "= 2e9, density = 1000 }\n[joints.clamp]\ntype = \"fixed\"\na = { body = \"ground\" }\nb = { body = \"rod\", "
      "node = "
      "1 }\n[joints.slot]\ntype = \"point-on-curve\"\na = { body = \"ground\", point = [1, 0, 0] }\nb = { body = "
      "\"rod\", "
      "node = -1 }\nends = \"straight\"\npoints = [[0, 0, 0], [-0.1, 0, 0.3]]\n[forces.pull]\ntype = "
      "\"load\"\na = { body = \"rod\", node = -1 }\nforce = [0, 0, 5]\n[statics]\n");
  EXPECT_GT(tip.value("slot.displacement"), 1e-5);
  EXPECT_NEAR(tip.value("slot.force.z"), tip.value("slot.force.x") / 3, 1e-6);
  EXPECT_NEAR(tip.value("clamp.force.x"), -tip.value("slot.force.x"), 1e-6);
  EXPECT_NEAR(tip.value("clamp.force.z"), -5 - tip.value("slot.force.z"), 1e-6);
}

}  // namespace joint_closed_forms_test
}  // namespace espalier::dynamics

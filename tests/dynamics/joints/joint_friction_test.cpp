// Friction and stops in joints. Truth: closed forms of sliding, creeping and braking; the energy balance of an impact.
#include <gtest/gtest.h>

#include <cmath>

#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace joint_friction_test {

/// A block of mass 3 on an incline of angle a (gravity 10 turned instead of the rail).
std::string incline(double angle, const std::string& friction, const std::string& more) {
  std::ostringstream text;
  text.precision(17);
  text << "gravity = [" << 10 * std::sin(angle) << ", " << -10 * std::cos(angle) << ", 0]\n"
       << "[bodies.block]\ntype = \"rigid\"\nmass = 3\nbox = [0.1, 0.1, 0.1]\n[joints.rail]\ntype = \"prismatic\"\n"
       << "bodies = [\"ground\", \"block\"]\nat = [0, 0, 0]\naxis = [1, 0, 0]\nfriction = { " << friction << " }\n"
       << "[integrator]\n"
       << more;
  return text.str();
}

TEST(JointFriction, BlockSlidesDownASteepIncline) {
  // Beyond some slip speeds tanh is 1: a = g (sin - mu cos); the run up to there takes about slip_speed / a.
  const double angle = 0.6, mu = 0.3;
  const Simulation s =
      simulated(incline(angle, "coefficient = 0.3, slip_speed = 1e-5", "relative = 1e-9\nabsolute = 1e-10\nend = 1\n"));
  EXPECT_NEAR(s.value("rail.speed"), 10 * (std::sin(angle) - mu * std::cos(angle)), 1e-4);
  EXPECT_NEAR(s.value("rail.friction_force"), mu * 30 * std::cos(angle), 1e-6);
}

TEST(JointFriction, BlockCreepsOnAFlatIncline) {
  // At rest but for v = slip_speed atanh(tan a / mu), with any method.
  const double angle = 0.2, mu = 0.3, speed = 1e-3 * std::atanh(std::tan(angle) / mu);
  for (const char* method :
       {"relative = 1e-8\nabsolute = 1e-12\nend = 1\n", "method = \"generalized-alpha\"\nstep = 1e-3\nend = 1\n"}) {
    const Simulation s = simulated(incline(angle, "coefficient = 0.3, slip_speed = 1e-3", method));
    EXPECT_NEAR(s.value("rail.speed"), speed, 1e-7 * speed + 1e-9) << method;
    EXPECT_NEAR(s.value("rail.friction_force"), 30 * std::sin(angle), 1e-5) << method;
  }
}

TEST(JointFriction, SticksByItsStaticAndSlidesByItsDynamicCoefficient) {
  // A pull that grows with time breaks away at static * N and is then held back by dynamic * N.
  const std::string pull = R"toml(relative = 1e-8
absolute = 1e-10
end = 3
[forces.pull]
type = "load"
a = { body = "block" }
force = ["6*t", 0, 0]
[events.away]
when = "rail.speed > 0.02"
once = true
)toml";
  const Simulation s =
      simulated(incline(0, "coefficient = 0.2, static = 0.4, slip_speed = 1e-4, stribeck_speed = 2e-3", pull));
  ASSERT_EQ(s.summary().events.size(), 1U);
  // mu has its maximum, 0.4, at 2 to 3 slip speeds; from there to 0.02 takes some 20 ms.
  EXPECT_NEAR(s.summary().events[0].t, 0.4 * 30 / 6, 0.03);
  EXPECT_NEAR(s.value("rail.friction_force"), 0.2 * 30, 1e-6);
}

TEST(JointFriction, BrakedRotorSlowsDownLinearly) {
  // The bearing carries the weight m g across its axis: torque mu r m g, whatever the speed; J = 0.2.
  const Simulation s = simulated(R"toml(gravity = [0, -10, 0]
[bodies.rotor]
type = "rigid"
mass = 4
inertia = [0.1, 0.1, 0.2]
angular_velocity = [0, 0, -30]
[joints.bearing]
type = "revolute"
bodies = ["ground", "rotor"]
at = [0, 0, 0]
axis = [0, 0, 1]
friction = { coefficient = 0.25, slip_speed = 1e-4, radius = 0.02 }
[integrator]
relative = 1e-9
absolute = 1e-10
end = 20
)toml");
  const double rate = 0.25 * 0.02 * 40 / 0.2;
  EXPECT_NEAR(s.value("bearing.angular_speed"), -30 + 20 * rate, 1e-6);
  EXPECT_NEAR(s.value("bearing.angle"), -30 * 20 + 0.5 * rate * 400, 1e-5);  // 64 turns
  EXPECT_NEAR(s.value("bearing.friction_moment"), -0.25 * 0.02 * 40, 1e-8);
}

TEST(JointFriction, AScrewingSleeveIsHeldBackAlongItsSlip) {
  // Turning and sliding share one friction force mu N against the slip (u, r w): at first both slow down in proportion,
  // m u' = -mu N u / s, J w' = -mu N r r w / s. With J = m r^2 the ratio stays, and s falls by mu N / m.
  const Simulation s = simulated(R"toml(gravity = [0, -10, 0]
[bodies.sleeve]
type = "rigid"
mass = 2
inertia = [0.02, 0.02, 0.02]
velocity = [3, 0, 0]
angular_velocity = [40, 0, 0]
[joints.shaft]
type = "cylindrical"
bodies = ["ground", "sleeve"]
at = [0, 0, 0]
axis = [1, 0, 0]
friction = { coefficient = 0.4, slip_speed = 1e-4, radius = 0.1 }
[integrator]
relative = 1e-9
absolute = 1e-10
end = 0.5
)toml");
  const double left = (5 - 0.4 * 10 * 0.5) / 5;
  EXPECT_NEAR(s.value("shaft.speed"), 3 * left, 1e-7);
  EXPECT_NEAR(s.value("shaft.angular_speed"), 40 * left, 1e-6);
}

TEST(JointFriction, ViscousFrictionDecaysExponentially) {
  const Simulation s = simulated(incline(0, "viscous = 1.2", "relative = 1e-10\nabsolute = 1e-11\nend = 2\n") +
                                 "[forces.kick]\ntype = \"load\"\na = { body = \"block\" }\nforce = [6, 0, 0]\n");
  EXPECT_NEAR(s.value("rail.speed"), 5 * (1 - std::exp(-1.2 * 2 / 3)), 1e-8);
}

/// w with a v - ln(1 + a v) = -a w - ln(1 - a w), by bisection.
double rebound(double v, double a) {
  const double left = a * v - std::log1p(a * v);
  double low = 0, high = std::min(v, 1 / a * (1 - 1e-12));
  for (int i = 0; i < 200; ++i) {
    const double w = 0.5 * (low + high);
    (-a * w - std::log1p(-a * w) < left ? low : high) = w;
  }
  return low;
}

TEST(JointStops, ReboundAsTheEnergyBalanceSays) {
  for (const double damping : {0.0, 0.05, 0.3})
    for (const double smoothing : {1e-4, 5e-3}) {
      std::ostringstream text;
      text << R"toml([bodies.cart]
type = "rigid"
mass = 2
box = [0.1, 0.1, 0.1]
velocity = [1.5, 0, 0]
[joints.rail]
type = "prismatic"
bodies = ["ground", "cart"]
at = [0, 0, 0]
axis = [1, 0, 0]
)toml"
           << "limits = { lower = -0.2, upper = 0.1, stiffness = 1e5, smoothing = " << smoothing
           << ", damping = " << damping << " }\n"
           << "[integrator]\nrelative = 1e-9\nabsolute = 1e-11\nend = 10\n"
           << "[events.back]\nwhen = \"rail.displacement < -0.1\"\nstop = true\n";
      const Simulation s = simulated(text.str());
      EXPECT_EQ(s.summary().stopped_by, "back");
      EXPECT_NEAR(s.value("rail.speed"), -rebound(1.5, damping > 0 ? damping : 1e-7), 2e-6)
          << damping << " " << smoothing;
      if (damping == 0) {
        EXPECT_NEAR(s.summary().energy_end.kinetic, 2.25, 1e-5);
      }
    }
}

TEST(JointStops, HoldAPendulumWhereItsWeightAndTheStopBalance) {
  // Penalty k (p - e/2) against the moment m g l sin(limit + p): a hinge that may turn to 0.3 only.
  const Simulation s = simulated("gravity = [10, 0, 0]\n" + hinged_bob("0.01", "[0, -1, 0]") +
                                 R"toml(limits = { upper = 0.3, stiffness = 1e4, smoothing = 1e-5, damping = 2 }
friction = { viscous = 5 }
[integrator]
end = 30
)toml");
  const double p = s.value("hinge.angle") - 0.3;
  EXPECT_NEAR(1e4 * (p - 0.5e-5), 20 * std::cos(s.value("hinge.angle")), 1e-3);
  EXPECT_NEAR(s.value("hinge.stop_moment"), 20 * std::cos(s.value("hinge.angle")), 1e-3);
}

// What friction stops rests in few steps, however far its slip speed lies below the tolerances: v^2 / (2 a), a = mu N /
// m = 2. Newton's iteration ended anywhere between the two directions of slip, and a million steps followed each other.
TEST(JointFriction, SlipSpeedsBelowTheTolerancesDoNotChatter) {
  for (const char* slip : {"1e-5", "1e-8"})
    for (const char* tolerance : {"1e-3", "1e-6"}) {
      const Simulation s = simulated(
          std::string(
              "[bodies.b]\ntype = \"rigid\"\nmass = 2\nbox = [0.1, 0.1, 0.1]\nvelocity = [1, 0, 0]\n[joints.r]\n"
              "type = \"prismatic\"\na = { body = \"ground\", axis = [1, 0, 0] }\nb = { body = \"b\" }\n"
              "friction = { coefficient = 0.2, preload = 20, slip_speed = ") +
          slip + " }\n[integrator]\nend = 2\nsteps = 2000\nrelative = 1e-4\nabsolute = 1e-4\nabsolute_velocity = " +
          tolerance + "\n");
      EXPECT_LT(s.summary().steps, 200) << slip << ", " << tolerance;
      EXPECT_EQ(s.summary().t_end, 2);
      EXPECT_NEAR(s.value("b.position.x"), 0.25, 2e-4) << slip << ", " << tolerance;
    }
}

}  // namespace joint_friction_test
}  // namespace espalier::dynamics

// Forces as functions of state. Truth: finite differences of F by q, v and lambda; quadrature; a reference integration
// of the reduced equation.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "dynamics/model/built_model.hpp"
#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace {

// Everything at once: bodies held by joints with stops and friction, a flexible bar, and forces that are functions of
// each other.
const std::string kTangle = R"toml(gravity = [0, 0, -9.81]
[splines.bump]
points = [[-3, 1], [-1, 0.5], [0, -0.2], [1, 0.8], [3, 2]]
outside = "linear"
[inputs]
gain = 1.5
[sensors]
lift = "two.position.z + 0.3*one.velocity.x*inputs.gain"
[bodies.one]
type = "rigid"
mass = 2
inertia = [0.5, 0.7, 0.9]
position = [0.5, 0.2, 0]
[bodies.two]
type = "rigid"
mass = 1.5
inertia = [0.4, 0.3, 0.6]
position = [1.2, -0.1, 0.4]
[bodies.bar]
type = "solid"
mesh = { part = "block", lx = 0.5, ly = 0.1, lz = 0.1, divisions = [2, 1, 1] }
material = { young = 1e4, poisson = 0.3, density = 100 }
position = [0, 1, 0]
[markers.tip]
body = "bar"
face = "x1"
[joints.hinge]
type = "revolute"
a = { body = "ground", point = [0.1, 0, 0], axis = [0.3, 0.1, 1] }
b = { body = "one", point = [-0.4, -0.2, 0.1], axis = [0.2, 0.2, 1] }
limits = { lower = -1e-3, upper = 1e-3, stiffness = 40, smoothing = 0.5, damping = 0.02 }
friction = { coefficient = 0.3, static = 0.5, slip_speed = 0.3, radius = 0.4, bending_arm = 0.6, collar_radius = 0.2, viscous = 0.1, preload = 0.3 }
[joints.sleeve]
type = "cylindrical"
a = { body = "one", point = [0.4, 0, 0], axis = [1, 0.2, 0.1] }
b = { body = "two", point = [-0.3, 0.2, -0.4], axis = [1, 0, 0] }
limits = { lower = 10, stiffness = 30, smoothing = 0.2, damping = 0.05 }
angle_limits = { upper = -4, stiffness = 20, smoothing = 20 }
friction = { coefficient = 0.2, static = 0.4, slip_speed = 0.2, stribeck_speed = 0.7, radius = 0.3, bending_arm = 0.5, viscous = 0.2, angular_viscous = 0.1 }
[joints.slide]
type = "prismatic"
a = { body = "two", point = [0.1, 0.3, 0], axis = [0, 1, 0.2] }
b = "tip"
friction = { coefficient = 0.25, slip_speed = 0.5, bending_arm = 0.4, torsion_arm = 0.3 }
[forces.leg]
type = "spring"
a = { body = "one", point = [0.1, 0.1, 0.2] }
b = { body = "two", point = [0, 0.2, 0] }
stiffness = 3
actuator = "bump(leg.rate) + 2*(leg.coordinate - 0.4)^3 + 0.1*hinge.force.norm + sensors.lift"
[forces.coil]
type = "rotational-spring"
a = { body = "one", axis = [0, 0, 1] }
b = { body = "two" }
damping = 0.3
actuator = "sin(hinge.angle) * sleeve.displacement + 0.2*leg.strength + sleeve.friction_moment"
[forces.drive]
type = "torque-motor"
a = { body = "ground", axis = [0, 0, 1] }
b = { body = "one" }
torque = "inputs.gain*(1 - hinge.angular_speed) - 0.3*sleeve.angle + t*tip.velocity.y"
[forces.push]
type = "force-motor"
a = { body = "one", axis = [0, 1, 1] }
b = { body = "two" }
force = "tanh(two.rotation.x) + 0.1*slide.moment.y + sleeve.speed^2 + hinge.stop_moment/20"
[forces.wind]
type = "load"
a = "tip"
force = ["two.velocity.norm", "-0.5*tip.angular_velocity.z + one.position.y", 0.3]
moment = ["leg.force.x", 0, "coil.moment.z*t"]
factor = "1 + 0.1*sensors.lift^2"
follower = true
[forces.plain]
type = "load"
a = { body = "two", point = [0.1, 0, 0] }
force = [1, 2, 3]
factor = "cos(one.rotation.z) + 0.05*drive.moment.z + 0.1*blow.pressure"
[forces.blow]
type = "pressure"
body = "bar"
face = "z1"
pressure = "3 + two.position.x^2 + 0.5*tip.velocity.z + 0.2*hinge.force.norm + 0.1*leg.strength*t"
[integrator]
end = 1
)toml";

TEST(StateForces, TangentsAgreeWithDifferences) {
  const auto mechanism = built(kTangle);
  for (unsigned seed = 1; seed <= 12; ++seed) {
    const State s = anywhere(*mechanism, seed, 0.3);
    const JacobianCheck check = check_jacobians(mechanism->system, s);
    // Third root of eps squared times second derivatives of the size of a hundred.
    EXPECT_LT(check.f_q, 2e-7) << "seed " << seed << ": " << check.worst;
    EXPECT_LT(check.f_v, 2e-7) << "seed " << seed << ": " << check.worst;
    EXPECT_LT(check.f_lambda, 2e-7) << "seed " << seed << ": " << check.worst;
  }
  ASSERT_NE(mechanism->system.multiplier_pattern(), nullptr);
  EXPECT_GT(mechanism->system.multiplier_pattern()->nonzeros(), 100);
}

/// A mass on a rail along x with one force on it.
std::string on_rail(const std::string& more, const std::string& start = "velocity = [0, 0, 0]") {
  return R"toml([bodies.cart]
type = "rigid"
mass = 2
box = [0.1, 0.1, 0.1]
)toml" + start +
         R"toml(
[joints.rail]
type = "prismatic"
bodies = ["ground", "cart"]
at = [0, 0, 0]
axis = [1, 0, 0]
[integrator]
relative = 1e-11
absolute = 1e-12
)toml" + more;
}

// m x'' = -k x - c x^3 from rest at x = 1: the quarter of a period is the integral of dx / v from 0 to 1 with
// v^2 = (k (1 - x^2) + c (1 - x^4) / 2) / m; x = sin(u) takes the root out of the denominator.
TEST(StateForces, HardSpringSwingsAsQuadratureSays) {
  const double m = 2, k = 30, c = 500;
  double quarter = 0;
  constexpr int kPanels = 2000;  // Simpson's rule; the integrand is smooth and even at both ends
  for (int i = 0; i <= kPanels; ++i) {
    const double x = std::sin(0.5 * std::numbers::pi * i / kPanels);
    const double weight = i == 0 || i == kPanels ? 1 : i % 2 == 1 ? 4 : 2;
    quarter += weight / std::sqrt((k + 0.5 * c * (1 + x * x)) / m);
  }
  quarter *= 0.5 * std::numbers::pi / kPanels / 3;
  const Simulation s = simulated(on_rail(R"toml(end = 10
[forces.spring]
type = "axial-spring"
a = { body = "ground", axis = [1, 0, 0] }
b = { body = "cart", axis = [1, 0, 0] }
rest = 0
actuator = "30*cart.position.x + 500*spring.coordinate^3"
[events.through]
when = "cart.position.x < 0"
stop = true
tolerance = 1e-12
)toml",
                                         "position = [1, 0, 0]"));
  EXPECT_EQ(s.summary().stopped_by, "through");
  EXPECT_NEAR(s.time(), quarter, 1e-8);
  EXPECT_NEAR(s.value("rail.speed"), -std::sqrt((k + 0.5 * c) / m), 1e-6);
}

// m v' = -c v |v|: v = v0 / (1 + c v0 t / m), x = m/c ln(1 + c v0 t / m).
TEST(StateForces, QuadraticDampingFollowsItsClosedForm) {
  const Simulation s = simulated(on_rail(R"toml(end = 3
[forces.drag]
type = "load"
a = { body = "cart" }
force = ["-0.7*cart.velocity.x*abs(cart.velocity.x)", 0, 0]
)toml",
                                         "velocity = [4, 0, 0]"));
  const double x = 1 + 0.7 * 4 * 3 / 2;
  EXPECT_NEAR(s.value("cart.velocity.x"), 4 / x, 1e-8);
  EXPECT_NEAR(s.value("cart.position.x"), 2 / 0.7 * std::log(x), 1e-8);
}

// J a'' = -m g l sin a - kp (a - 1) - kd a', J = m l^2 + I, by Runge and Kutta's method with 20,000 steps.
TEST(StateForces, ControlledPendulumFollowsItsReducedEquation) {
  const double m = 2, g = 10, inertia = m + 0.01, kp = 40, kd = 3;
  double a = 0, w = 0;
  const auto rate = [&](double angle, double speed) {
    return (-m * g * std::sin(angle) - kp * (angle - 1) - kd * speed) / inertia;
  };
  constexpr int kSteps = 20000;
  const double h = 1.5 / kSteps;
  for (int i = 0; i < kSteps; ++i) {
    const double a1 = w, w1 = rate(a, w), a2 = w + 0.5 * h * w1, w2 = rate(a + 0.5 * h * a1, w + 0.5 * h * w1);
    const double a3 = w + 0.5 * h * w2, w3 = rate(a + 0.5 * h * a2, w + 0.5 * h * w2);
    const double a4 = w + h * w3, w4 = rate(a + h * a3, w + h * w3);
    a += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
    w += h / 6 * (w1 + 2 * w2 + 2 * w3 + w4);
  }
  const Simulation s = simulated("gravity = [0, -10, 0]\n" + hinged_bob("0.01", "[0, -1, 0]") + R"toml([forces.motor]
type = "torque-motor"
bodies = ["ground", "bob"]
at = [0, 0, 0]
axis = [0, 0, 1]
torque = "40*(1 - hinge.angle) - 3*hinge.angular_speed"
[integrator]
relative = 1e-10
absolute = 1e-11
end = 1.5
)toml");
  EXPECT_NEAR(s.value("hinge.angle"), a, 1e-7);
  EXPECT_NEAR(s.value("hinge.angular_speed"), w, 1e-6);
  EXPECT_NEAR(s.value("motor.strength"), -(40 * (1 - a) - 3 * w), 1e-5);
}

// A spring that is given as numbers and one that is given as an expression are the same force; so are both methods of
// stating a load.
TEST(StateForces, ExpressionsDoWhatNumbersDo) {
  const auto end = [](const std::string& force) {
    return simulated(on_rail("end = 0.7\n" + force, "position = [1, 0, 0]\nvelocity = [0.3, 0, 0]"))
        .value("cart.position.x");
  };
  const std::string frames =
      "type = \"axial-spring\"\na = { body = \"ground\", axis = [1, 0, 0] }\nb = { body = \"cart\" }\n";
  EXPECT_NEAR(end("[forces.s]\n" + frames + "stiffness = 50\ndamping = 2\nrest = 0.4\n"),
              end("[forces.s]\n" + frames + "rest = 0\nactuator = \"50*(s.coordinate - 0.4) + 2*s.rate\"\n"), 1e-9);
  EXPECT_NEAR(end("[forces.l]\ntype = \"load\"\na = { body = \"cart\" }\nforce = [3, 0, 0]\nfactor = \"sin(5*t)\"\n"),
              end("[forces.l]\ntype = \"load\"\na = { body = \"cart\" }\nforce = [\"3*sin(5*t)\", 0, 0]\n"), 1e-12);
}

}  // namespace
}  // namespace espalier::dynamics

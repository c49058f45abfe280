// Derivatives of motions by the adjoint method. Truths: the forward method; a closed form; differences of whole runs.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "dynamics/model/model_common.hpp"
#include "espalier/sensitivities.hpp"

namespace espalier {
namespace motion_adjoint_test {

using Parameters = std::vector<SensitivityParameter>;

SensitivityResult by(SensitivityMethod method, const std::string& text, const Parameters& parameters) {
  SensitivityResult r = sensitivities_of_text(text, "model.toml", parameters, {}, method);
  EXPECT_TRUE(r.status.ok()) << r.status.message;
  return r;
}

/// A parameter and the step of its differences, of which both methods are compared in the limit, from two steps: the
/// forward method moves the states by it, too, so its error is another one. They are wide enough to leave rounding
/// behind.
struct Moved {
  std::string path;
  double step;
};

void expect_forward(const std::string& text, const std::vector<Moved>& moved, double tolerance) {
  Parameters one, two;
  for (const Moved& p : moved) {
    one.push_back({p.path, p.step});
    two.push_back({p.path, 2 * p.step});
  }
  const SensitivityResult near = by(SensitivityMethod::forward, text, one),
                          far = by(SensitivityMethod::forward, text, two);
  const SensitivityResult adjoint = by(SensitivityMethod::adjoint, text, one),
                          adjoint_far = by(SensitivityMethod::adjoint, text, two);
  ASSERT_EQ(adjoint.t.size(), 1U);
  ASSERT_EQ(far.derivatives.size(), near.derivatives.size());
  ASSERT_EQ(adjoint_far.derivatives.size(), adjoint.derivatives.size());
  EXPECT_TRUE(adjoint.adjoint);
  EXPECT_LT(adjoint.defect, 1e-6);
  EXPECT_EQ(adjoint.t[0], near.t.back());
  ASSERT_EQ(adjoint.derivatives.size(), near.quantities.size() * moved.size());
  double worst = 0;
  for (const std::string& q : near.quantities) {
    EXPECT_EQ(adjoint.value(q), near.value(q)) << q;
    for (const Moved& p : moved) {
      const double truth = (4 * near.derivative(q, p.path) - far.derivative(q, p.path)) / 3;
      const double found = (4 * adjoint.derivative(q, p.path) - adjoint_far.derivative(q, p.path)) / 3;
      const double error = std::abs(found - truth) / std::max(std::abs(truth), 1e-3);
      worst = std::max(worst, error);
      EXPECT_LT(error, tolerance) << q << " by " << p.path << ": " << truth;
    }
  }
  std::printf("%zu steps, tangents to %.1e, methods differ by %.1e\n", near.t.size() - 1, adjoint.defect, worst);
}

// Two bodies and a ball on a spring, in space; a parameter that moves frames, velocities of the start.
std::string linkage(const std::string& integrator) {
  return R"(
gravity = [0, 0, -9.81]
[parameters]
length = 0.8
damping = 0.3
speed = 1.5
[bodies.upper]
type = "rigid"
mass = 1.2
box = ["length", 0.1, 0.1]
position = ["length/2", 0, 0]
[bodies.lower]
type = "rigid"
mass = 0.9
box = [0.7, 0.05, 0.2]
position = ["length + 0.35", 0, 0]
[bodies.ball]
type = "point"
mass = 0.3
position = ["length + 0.7", 0.2, 0]
velocity = [0, "speed", 0.5]
[joints]
top = { type = "universal", a = { body = "ground", axis = [0, 0, 1] }, b = { body = "upper", point = ["-length/2", 0, 0] } }
elbow = { type = "revolute", a = { body = "upper", point = ["length/2", 0, 0], axis = [0, 1, 0] }, b = { body = "lower", point = [-0.35, 0, 0], axis = [0, 1, 0] } }
[forces]
damper = { type = "rotational-spring", a = { body = "upper", point = ["length/2", 0, 0], axis = [0, 1, 0] }, b = { body = "lower", point = [-0.35, 0, 0], axis = [0, 1, 0] }, stiffness = 0.5, damping = "damping" }
push = { type = "load", a = { body = "upper" }, force = [0, 2, 0] }
rope = { type = "spring", a = { body = "lower", point = [0.35, 0, 0] }, b = { body = "ball" }, stiffness = 20, damping = 0.1, rest = 0.1 }
[output]
quantities = ["upper.position.z", "lower.angular_velocity", "ball.position.y", "top.force", "elbow.angle", "energy.total"]
[integrator]
)" + integrator;
}

const std::vector<Moved> kOfLinkage = {{"parameters.length", 1e-4},     {"parameters.damping", 1e-4},
                                       {"parameters.speed", 1e-3},      {"bodies.upper.mass", 2e-4},
                                       {"forces.push.force.1", 1e-3},   {"forces.rope.stiffness", 1e-2},
                                       {"bodies.ball.velocity.2", 5e-4}};

TEST(MotionAdjoint, OfAMechanismIsForward) {
  expect_forward(linkage("end = 0.2\nrelative = 1e-7\nabsolute = 1e-8\n"), kOfLinkage, 1e-8);
}

// Passes backward gain in turns here: one without gain is not the end.
TEST(MotionAdjoint, OfAPendulumAtDefaultTolerancesIsForward) {
  const std::string kept = "relative = 1e-10\nabsolute = 1e-10\n";
  const std::string text = dynamics::replaced(dynamics::kPendulum, kept, "") + R"([output]
quantities = ["bob.position.x", "bob.velocity.y", "hinge.force"]
)";
  expect_forward(text, {{"bodies.bob.mass", 2e-4}, {"gravity.1", 1e-3}}, 1e-6);
}

TEST(MotionAdjoint, OfConstantStepsIsForward) {
  expect_forward(linkage("end = 0.06\nstep = 2e-3\norder = 2\n"), kOfLinkage, 4e-8);
  expect_forward(linkage("end = 0.1\nmethod = \"generalized-alpha\"\nspectral_radius = 0.6\nstep = 4e-3\n"), kOfLinkage,
                 2e-8);
}

// A closed loop of four hinges in a plane (three rows of constraints are left out) with friction, which makes forces
// depend on multipliers; a beam with nodes of its own on it.
TEST(MotionAdjoint, OfALoopWithFrictionAndABeamIsForward) {
  const std::string text = R"(
gravity = [0, -9.81, 0]
[bodies.crank]
type = "rigid"
mass = 1
box = [0.05, 0.3, 0.05]
position = [0, 0.15, 0]
angular_velocity = [0, 0, -3]
[bodies.rod]
type = "rigid"
mass = 1
box = [1, 0.05, 0.05]
position = [0.5, 0.3, 0]
velocity = [0.9, 0, 0]
[bodies.rocker]
type = "rigid"
mass = 1
box = [0.05, 0.3, 0.05]
position = [1, 0.15, 0]
angular_velocity = [0, 0, -3]
[bodies.blade]
type = "beam"
start = [0.5, 0.325, 0]
end = [0.5, 0.625, 0]
elements = 2
height = 0.01
width = 0.02
material = { young = 1e6, poisson = 0, density = 1000 }
damping = { stiffness = 1e-2 }
velocity = [0.9, 0, 0]
[joints]
a = { type = "revolute", bodies = ["ground", "crank"], at = [0, 0, 0], axis = [0, 0, 1], friction = { coefficient = 0.2, slip_speed = 0.1, radius = 0.02 } }
b = { type = "revolute", bodies = ["crank", "rod"], at = [0, 0.3, 0], axis = [0, 0, 1] }
c = { type = "revolute", bodies = ["rod", "rocker"], at = [1, 0.3, 0], axis = [0, 0, 1] }
d = { type = "revolute", bodies = ["rocker", "ground"], at = [1, 0, 0], axis = [0, 0, 1] }
foot = { type = "fixed", a = { body = "rod", point = [0, 0.025, 0] }, b = { body = "blade", node = 1 } }
[output]
quantities = ["crank.angular_velocity.z", "b.force.x", "blade.position.x", "a.friction_moment"]
[initial]
velocities = "project"
[integrator]
end = 0.008
max_step = 2e-3
relative = 1e-5
absolute = 1e-7
)";
  expect_forward(
      text, {{"joints.a.friction.coefficient", 1e-3}, {"bodies.rod.mass", 2e-3}, {"bodies.blade.height", 2e-5}}, 1e-6);
}

// A shape that turns with a frame of its own, and a start in equilibrium.
TEST(MotionAdjoint, OfAReducedBodyIsForward) {
  const std::string text = R"(
gravity = [0, 0, -9.81]
[parameters]
density = 500
[bodies.arm]
type = "solid"
mesh = { part = "block", lx = 0.7, ly = 0.05, lz = 0.08, divisions = [4, 1, 1] }
material = { young = 2e8, poisson = 0.3, density = "density" }
damping = { stiffness = 2e-3 }
reduce = { modes = 3 }
[joints]
hinge = { type = "revolute", a = { body = "ground", axis = [0, 1, 0] }, b = { body = "arm", face = "x0", axis = [0, 1, 0] } }
[output]
quantities = ["arm.position.z", "hinge.force.z"]
[integrator]
end = 0.1
relative = 1e-6
absolute = 1e-7
)";
  expect_forward(text, {{"parameters.density", 1}, {"bodies.arm.damping.stiffness", 8e-5}}, 5e-6);
}

// Without friction and restitution contacts are forces like others.
TEST(MotionAdjoint, OfABouncingBallIsForward) {
  const auto ball = [](const std::string& law) {
    return "gravity = [0, 0, -9.81]\n[bodies.ball]\ntype = \"rigid\"\nmass = 2\ninertia = [0.01, 0.01, 0.01]\nposition "
           "= "
           "[0, 0, 0.12]\n[surfaces.ball]\nbody = \"ball\"\nshape = \"sphere\"\nradius = 0.1\n[surfaces.floor]\nbody = "
           "\"ground\"\nshape = \"plane\"\n[contacts.c]\nsurfaces = [\"floor\", \"ball\"]\nstiffness = 1e4\nexponent = "
           "1.5\n" +
           law +
           "\n[integrator]\nend = 0.15\nrelative = 1e-7\nabsolute = 1e-9\n[output]\nquantities = "
           "[\"ball.position.z\"]\n";
  };
  expect_forward(ball("damping = 0.2"),
                 {{"contacts.c.stiffness", 1}, {"contacts.c.damping", 1e-4}, {"bodies.ball.mass", 2e-4}}, 1e-6);
  const auto refused = [&](const std::string& law) {
    return sensitivities_of_text(ball(law), "model.toml", {{"bodies.ball.mass"}}, {}, SensitivityMethod::adjoint)
        .status;
  };
  for (const char* law : {"friction = 0.2\ntangential_stiffness = 1e4", "restitution = 0.5"}) {
    EXPECT_EQ(refused(law).code, StatusCode::invalid_input) << law;
    EXPECT_NE(refused(law).message.find("remember"), std::string::npos) << refused(law).message;
  }
}

const std::string kOscillator = R"(
[parameters]
k = 4
m = 2
[bodies.mass]
type = "point"
mass = "m"
position = [1.5, 0, 0]
[forces.spring]
type = "spring"
a = { body = "ground" }
b = { body = "mass" }
stiffness = "k"
rest = 1
[output]
quantities = ["mass.position.x", "mass.velocity.x"]
[integrator]
end = 3
relative = 1e-8
absolute = 1e-9
)";

// J = the integral of (x - 1)^2 + 0.1 v^2 by the trapezium rule. Truth: the chain rule with the forward derivatives of
// all times; x = 1 + x0 cos(w t), J = x0^2 (T/2 + sin(2 w T)/(4 w)) and so on, to the error of the rule.
TEST(MotionAdjoint, OfAnObjective) {
  const Parameters parameters = {{"parameters.k"}, {"parameters.m"}};
  const auto share = [](const std::vector<double>& t, std::size_t i) {
    return 0.5 * ((i + 1 < t.size() ? t[i + 1] : t[i]) - (i > 0 ? t[i - 1] : t[i]));
  };
  std::size_t calls = 0;
  const SensitivityObjective objective = [&](const std::vector<double>& t, const std::vector<double>& values,
                                             std::vector<double>& slopes) {
    ++calls;
    double sum = 0;
    for (std::size_t i = 0; i < t.size(); ++i) {
      const double x = values[2 * i] - 1, v = values[2 * i + 1], w = share(t, i);
      sum += w * (x * x + 0.1 * v * v);
      slopes[2 * i] = 2 * w * x;
      slopes[2 * i + 1] = 0.2 * w * v;
    }
    return sum;
  };
  const SensitivityResult r = objective_gradient_of_text(kOscillator, "model.toml", parameters, objective);
  ASSERT_TRUE(r.status.ok()) << r.status.message;
  EXPECT_EQ(calls, 1U);
  ASSERT_EQ(r.quantities, std::vector<std::string>{"objective"});
  ASSERT_EQ(r.derivatives.size(), 2U);
  const SensitivityResult forward = by(SensitivityMethod::forward, kOscillator, parameters);
  std::vector<double> slopes(forward.values.size()), chain(2, 0.0);
  EXPECT_EQ(objective(forward.t, forward.values, slopes), r.value("objective"));
  for (std::size_t i = 0; i < slopes.size(); ++i)
    for (std::size_t p = 0; p < 2; ++p) chain[p] += slopes[i] * forward.derivatives[2 * i + p];
  for (std::size_t p = 0; p < 2; ++p) EXPECT_NEAR(r.derivatives[p] / chain[p], 1, 3e-8) << p;
  const double w = std::sqrt(2.0), end = 3, x2 = 0.25;
  const double sine = std::sin(2 * w * end), cosine = std::cos(2 * w * end);
  const double squares = 0.1 * x2 * (w * end - sine / 2 + w * w * (0 * end) - w * end * cosine / 2 + sine / 4) +
                         x2 * (end * cosine / (2 * w) - sine / (4 * w * w));  // dJ/dw
  EXPECT_NEAR(r.derivatives[0], squares * w / 8, 2e-3);
}

TEST(MotionAdjoint, SaysWhatItCannot) {
  const Parameters k = {{"parameters.k"}};
  const auto objective = [&](double value, std::size_t slopes_more, double slope) {
    return objective_gradient_of_text(kOscillator, "model.toml", k,
                                      [=](const auto&, const auto&, std::vector<double>& slopes) {
                                        slopes.assign(slopes.size() + slopes_more, slope);
                                        return value;
                                      })
        .status;
  };
  EXPECT_TRUE(objective(0, 0, 1).ok());
  for (const Status& s : {objective(NAN, 0, 1), objective(0, 1, 1), objective(0, 0, INFINITY)}) {
    EXPECT_EQ(s.code, StatusCode::invalid_input);
    EXPECT_NE(s.message.find("objective"), std::string::npos) << s.message;
  }
  EXPECT_THROW(objective_gradient_of_text(kOscillator, "model.toml", k, nullptr), std::invalid_argument);
  EXPECT_EQ(
      objective_gradient("/there/is/none.toml", k, [](const auto&, const auto&, auto&) { return 0.0; }).status.code,
      StatusCode::invalid_input);
  std::string text = kOscillator + "[initial]\nmodes = 1\n";
  const SensitivityResult modes = sensitivities_of_text(text, "model.toml", k, {}, SensitivityMethod::adjoint);
  EXPECT_NE(modes.status.message.find("modes"), std::string::npos) << modes.status.message;
  SimulationOptions stopped;
  stopped.interrupted = [] { return true; };
  const SensitivityResult none =
      sensitivities_of_text(kOscillator, "model.toml", k, stopped, SensitivityMethod::adjoint);
  EXPECT_EQ(none.status.code, StatusCode::cancelled) << none.status.message;
}

// The objective of an equilibrium: the chain rule at its one row.
TEST(MotionAdjoint, ObjectiveOfAnEquilibrium) {
  std::string text =
      kOscillator.substr(0, kOscillator.find("[output]")) +
      "[forces.pull]\ntype = \"load\"\na = { body = \"mass\" }\nforce = [0.2, 0, 0]\n[forces.hold]\ntype = "
      "\"bushing\"\na = { body = \"ground\", point = [1.5, 0, 0] }\nb = { body = \"mass\" }\nstiffness = [0, 1, "
      "1]\n[output]\nquantities = [\"mass.position.x\"]\n[statics]\n";
  const SensitivityResult r =
      objective_gradient_of_text(text, "model.toml", {{"parameters.k"}},
                                 [](const auto&, const std::vector<double>& x, std::vector<double>& slopes) {
                                   slopes[0] = 2 * x[0];
                                   return x[0] * x[0];
                                 });
  ASSERT_TRUE(r.status.ok()) << r.status.message;
  EXPECT_NEAR(r.value("objective"), 1.05 * 1.05, 1e-9);  // 1 + F / k
  EXPECT_NEAR(r.derivatives[0], 2 * 1.05 * -0.2 / 16, 1e-7);
}

}  // namespace motion_adjoint_test
}  // namespace espalier

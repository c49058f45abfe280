// Every parameter of a model that stands for a limit (friction that sticks, stops that do not give, ...) is refined:
// the error falls at its rate, and nothing gives in on the way. Truth: closed forms of the limit.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>

#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace refinement_test {

/// Prints a line of the table and checks the rate: errors fall by `factor` (to half of it and better) from one value of
/// the parameter to the next until they are below `floor`.
void refine(const std::string& name, const std::vector<double>& values, double factor, double floor,
            const std::function<double(double)>& error) {
  std::string line = name + ":";
  double before = 0;
  for (const double value : values) {
    const double now = std::abs(error(value));
    line += fmt::format("  {:g} {:.1e}", value, now);
    if (before > 0) {
      EXPECT_LT(now, std::max(before / (0.5 * factor), floor)) << line;
    }
    before = now;
  }
  fmt::print("{}\n", line);
}

constexpr double kG = 10;

/// A block that slides along x on a rail with a speed of 2.
std::string slider(const std::string& friction, double end) {
  return fmt::format(R"(gravity = [0, 0, -10]
[bodies.block]
type = "rigid"
mass = 3
inertia = [1, 1, 1]
velocity = [2, 0, 0]
[joints.rail]
type = "prismatic"
bodies = ["ground", "block"]
at = [0, 0, 0]
axis = [1, 0, 0]
friction = {{ {} }}
[integrator]
relative = 1e-9
absolute = 1e-11
absolute_velocity = 1e-11
end = {}
)",
                     friction, end);
}

// Coulomb: it stops after v^2 / (2 mu g). What still creeps, and the slower end of the way, is as long as slip_speed.
TEST(Refinement, FrictionsSlipSpeed) {
  refine("slip_speed", {0.1, 0.01, 1e-3, 1e-4}, 10, 1e-9, [](double slip) {
    const Simulation s = simulated(slider(fmt::format("coefficient = 0.5, slip_speed = {}", slip), 0.6));
    return s.value("block.position.x") - 4 / (2 * 0.5 * kG);
  });
}

/// A ball that falls from 1 onto a stop at 0.
std::string ball(double stiffness, double smoothing, double damping, double end) {
  return fmt::format(R"(gravity = [0, 0, -10]
[bodies.ball]
type = "rigid"
mass = 1
inertia = [1, 1, 1]
position = [0, 0, 1]
[joints.rail]
type = "prismatic"
a = {{ body = "ground", axis = [0, 0, 1] }}
b = {{ body = "ball", axis = [0, 0, 1] }}
limits = {{ lower = 0, stiffness = {}, smoothing = {}, damping = {} }}
[integrator]
relative = 1e-10
absolute = 1e-12
absolute_velocity = 1e-10
end = {}
)",
                     stiffness, smoothing, damping, end);
}

// A rigid stop gives the speed back at once: back at the top after 2 sqrt(2 h / g), h = 1; an elastic one holds the
// ball for pi sqrt(m / k) longer.
TEST(Refinement, AStopsStiffness) {
  const double top = 2 * std::sqrt(2 / kG);
  refine("stiffness", {1e4, 1e6, 1e8}, 10, 1e-9, [&](double k) {
    const Simulation s = simulated(ball(k, 1e-3 / std::sqrt(k), 0, top - 0.2));
    return s.value("ball.position.z") - (1 - 0.5 * kG * 0.04);
  });
}

// A stop of linear stiffness from the first touch on: the contact lasts pi sqrt(m / k) but for terms of g.
TEST(Refinement, AStopsSmoothing) {
  constexpr double k = 1e6;
  const double w = std::sqrt(k), v = std::sqrt(2 * kG);
  const auto after = [&](double smoothing) {
    return simulated(ball(k, smoothing, 0, std::sqrt(2 / kG) + 0.2)).value("ball.position.z");
  };
  // m x'' = -k x - m g from x = 0, x' = -v: back at x = 0 after 2 / w (pi / 2 + atan(g / (w v))) less ... by symmetry
  // about the deepest point at tan(w t) = -w v / g.
  const double contact = 2 / w * (std::numbers::pi - std::atan(w * v / kG));
  const double t = 0.2 - contact, truth = v * t - 0.5 * kG * t * t;
  refine("smoothing", {1e-3, 1e-4, 1e-5, 1e-6}, 10, 1e-8, [&](double e) { return after(e) - truth; });
}

// Free fall from 1 ends at sqrt(2 / g): the event is found after it, by no more than the tolerance.
TEST(Refinement, AnEventsTolerance) {
  refine("event tolerance", {1e-2, 1e-4, 1e-6, 1e-8}, 1e-9, 1e300, [](double tolerance) {
    const Simulation s = simulated(fmt::format(R"(gravity = [0, 0, -10]
[bodies.ball]
type = "point"
mass = 1
position = [0, 0, 1]
[events.ground]
when = "ball.position.z < 0"
stop = true
tolerance = {}
[integrator]
relative = 1e-10
absolute = 1e-12
end = 2
)",
                                               tolerance));
    const double late = s.time() - std::sqrt(2 / kG);
    EXPECT_GE(late, -1e-11);
    EXPECT_LE(late, tolerance + 1e-11);
    return late;
  });
}

// ---- What nobody would choose

/// A soft block that a pressure pulls.
std::string block(const std::string& integrator, double density = 1000) {
  return fmt::format(R"([bodies.b]
type = "solid"
mesh = {{ part = "block", divisions = [2, 1, 1] }}
material = {{ young = 1e7, poisson = 0.3, density = {} }}
[joints.w]
type = "fixed"
a = {{ body = "ground", point = [0, 0.5, 0.5] }}
b = {{ body = "b", face = "x0" }}
[markers.end]
body = "b"
face = "x1"
[forces.p]
type = "pressure"
body = "b"
face = "x1"
pressure = 1e6
[integrator]
end = 0.05
max_order = 2
relative = 1e-5
absolute = 1e-7
absolute_velocity = 1e-4
{}
)",
                     density, integrator);
}

// A first step that turns elements inside out is too long, and no more.
TEST(Extremes, AFirstStepOfAnyLength) {
  const double truth = simulated(block("")).value("end.position.x");
  for (const char* first : {"initial_step = 1e300", "initial_step = 0.05", "initial_step = 1e-3"})
    EXPECT_NEAR(simulated(block(first)).value("end.position.x"), truth, 1e-3) << first;
}

TEST(Extremes, MassesThatAreNoneAreAnErrorAndNoBug) {
  Simulation s;
  ASSERT_TRUE(s.load_text(block("", 1e-300), "model.toml").ok());
  const Status status = s.run();
  EXPECT_EQ(status.code, StatusCode::accuracy_not_reached);
  EXPECT_NE(status.message.find("step size fell below"), std::string::npos) << status.message;
}

/// cos(3 t) from points, followed by a spring's actuator without mass in between: x'' = f(t).
double spline_error(const std::string& kind, int pieces) {
  std::string points;
  for (int k = 0; k <= pieces; ++k) {
    const double t = 2.0 * k / pieces;
    points += fmt::format("{}[{:.17g}, {:.17g}]", k > 0 ? ", " : "", t, std::cos(3 * t));
  }
  const Simulation s = simulated(fmt::format(R"x([splines.f]
points = [{}]
kind = "{}"
[bodies.ball]
type = "point"
mass = 1
[forces.push]
type = "load"
a = {{ body = "ball" }}
force = ["f(t)", 0, 0]
[integrator]
relative = 1e-10
absolute = 1e-12
end = 2
)x",
                                             points, kind));
  return s.value("ball.position.x") - (1 - std::cos(6.0)) / 9;
}

TEST(Refinement, PointsOfSplines) {
  const std::vector<double> pieces = {16, 32, 64, 128};
  refine("linear spline", pieces, 4, 1e-9, [](double n) { return spline_error("linear", static_cast<int>(n)); });
  refine("akima spline", pieces, 4, 1e-9, [](double n) { return spline_error("akima", static_cast<int>(n)); });
  refine("cubic spline", pieces, 4, 1e-9, [](double n) { return spline_error("cubic", static_cast<int>(n)); });
}

// Truth: 32 elements in one piece, whose own error is 1e-8.
TEST(Refinement, ElementsAndPiecesOfASaggingBeam) {
  const auto sag = [](int pieces, int elements) {
    std::string text = "gravity = [0, 0, -10]\n";
    const double length = 2.0 / pieces;
    for (int k = 0; k < pieces; ++k) {
      text += fmt::format(
          "[bodies.b{0}]\ntype = \"beam\"\nstart = [{1:.17g}, 0, 0]\nend = [{2:.17g}, 0, 0]\ny = [0, 1, 0]\nelements = "
          "{3}\nheight = 0.02\nwidth = 0.02\nmaterial = {{ young = 1e9, poisson = 0, density = 1000 }}\n",
          k, k * length, (k + 1) * length, elements / pieces);
      text += fmt::format("[joints.j{0}]\ntype = \"fixed\"\na = {1}\nb = {{ body = \"b{0}\", node = 1 }}\n", k,
                          k == 0 ? "{ body = \"ground\" }" : fmt::format("{{ body = \"b{}\", node = -1 }}", k - 1));
    }
    text += fmt::format("[markers.end]\nbody = \"b{}\"\nnode = -1\n[statics]\n", pieces - 1);
    return simulated(text).value("end.position.z");
  };
  const double truth = sag(1, 32);
  EXPECT_LT(truth, -0.5);
  refine("elements", {4, 8, 16}, 10, 1e-9, [&](double n) { return sag(1, static_cast<int>(n)) - truth; });
  refine("elements in 4 pieces", {4, 8, 16}, 10, 1e-9, [&](double n) { return sag(4, static_cast<int>(n)) - truth; });
}

}  // namespace refinement_test
}  // namespace espalier::dynamics

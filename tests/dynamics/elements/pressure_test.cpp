// Pressures as functions of the state. Truth: closed forms of bars under uniaxial stress; differences are in
// model_state_forces_test.cpp.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace pressure_test {

/// A bar of length 2 and section 1 with E = 1e6 and Poisson's ratio 0, fixed at x = 0.
std::string bar(const std::string& pressure, const std::string& rest = "[statics]\n") {
  return R"([bodies.bar]
type = "solid"
mesh = { part = "block", lx = 2, ly = 1, lz = 1, divisions = [3, 2, 2] }
material = { young = 1e6, poisson = 0, density = 500 }
[joints.wall]
type = "fixed"
a = { body = "ground", point = [0, 0.5, 0.5] }
b = { body = "bar", face = "x0" }
[markers.end]
body = "bar"
face = "x1"
[forces.gas]
type = "pressure"
body = "bar"
face = "x1"
pressure = )" +
         pressure + "\n" + rest;
}

/// Stretch of a bar of Saint-Venant and Kirchhoff's material under p(stretch): E L (L^2 - 1) / 2 = -p, by halving.
template <class Pressure>
double stretch(const Pressure& p) {
  double low = 0.6, high = 1.2;
  const auto surplus = [&](double x) { return 1e6 * x * (x * x - 1) / 2 + p(x); };
  for (int k = 0; k < 60; ++k) (surplus(0.5 * (low + high)) > 0 ? high : low) = 0.5 * (low + high);
  return low;
}

TEST(Pressure, ExpressionsOfPositionsFindTheirEquilibrium) {
  // A gas between the end and a wall at x = 3: p V = p0 V0.
  const Simulation s = simulated(bar("\"8e4*1/(3 - end.position.x)\""));
  const double x = stretch([](double l) { return 8e4 / (3 - 2 * l); });
  EXPECT_LT(x, 0.95);  // finite strain
  EXPECT_NEAR(s.value("end.position.x"), 2 * x, 1e-8);
  EXPECT_NEAR(s.value("gas.pressure"), 8e4 / (3 - 2 * x), 1e-3);
  EXPECT_NEAR(s.value("wall.force.x"), 8e4 / (3 - 2 * x), 1e-3);
}

TEST(Pressure, ExpressionsOfReactionsFindTheirEquilibrium) {
  // The pressure that makes half of itself and 3e4: 6e4. Its derivative by the multipliers stands in F_lambda.
  const Simulation s = simulated(bar("\"3e4 + 0.5*wall.force.x\""));
  EXPECT_NEAR(s.value("end.position.x"), 2 * stretch([](double) { return 6e4; }), 1e-8);
}

TEST(Pressure, NumbersInputsAndSplinesDoToo) {
  const double x = 2 * stretch([](double) { return 5e4; });
  EXPECT_NEAR(simulated(bar("5e4")).value("end.position.x"), x, 1e-8);
  EXPECT_NEAR(simulated(bar("\"inputs.p\"", "[inputs]\np = 5e4\n[statics]\n")).value("end.position.x"), x, 1e-8);
  EXPECT_NEAR(simulated(bar("\"of(end.position.x)\"",
                            "[splines.of]\npoints = [[1, 5e4], [3, 5e4]]\nkind = \"linear\"\n[statics]\n"))
                  .value("end.position.x"),
              x, 1e-8);
}

TEST(Pressure, IsSwitchedByEvents) {
  const std::string motion =
      "[events.valve]\nwhen = \"t > 0.01\"\non = [\"gas\"]\n[integrator]\nend = {}\nmax_order = 2\n";
  const Simulation before = simulated(bar("5e4\nactive = false", fmt::format(fmt::runtime(motion), 0.009)));
  EXPECT_EQ(before.value("gas.pressure"), 0);
  EXPECT_NEAR(before.value("end.position.x"), 2, 1e-12);
  // Truth: a step load travels along the bar with c = sqrt(E / rho) and moves its end with -p / (rho c) meanwhile.
  const Simulation after = simulated(bar("5e3\nactive = false", fmt::format(fmt::runtime(motion), 0.03)));
  EXPECT_EQ(after.value("gas.pressure"), 5e3);
  const double c = std::sqrt(1e6 / 500);
  EXPECT_NEAR((2 - after.value("end.position.x")) / (0.02 * 5e3 / (500 * c)), 1, 0.1);
}

// Truth: a constant pressure has the potential p V. Poisson's ratio 0 and a bar that only stretches: V = 2 x of the
// end.
TEST(Pressure, ConstantItHasAPotential) {
  const Simulation s =
      simulated(bar("5e4", "[integrator]\nend = 0.05\nrelative = 1e-8\nabsolute = 1e-8\nabsolute_velocity = 1e-6\n"));
  const double work = 5e4 * (2 - s.value("end.position.x")), energy = s.value("energy.total");
  EXPECT_GT(std::abs(work), 100);
  EXPECT_NEAR(energy, work, 1e-3 * 5e4 * 0.2);
}

TEST(Pressure, ItsOwnValueIsACircle) {
  Simulation s;
  const Status status = s.load_text(bar("\"1 + gas.pressure\""), "model.toml");
  EXPECT_EQ(status.code, StatusCode::invalid_input);
  EXPECT_NE(status.message.find("depends on itself: gas -> gas"), std::string::npos) << status.message;
}

}  // namespace pressure_test
}  // namespace espalier::dynamics

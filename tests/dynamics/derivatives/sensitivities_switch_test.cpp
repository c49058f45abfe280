// Derivatives through switches whose times move with a parameter: limits, impacts, jumps. Truth: closed forms.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "dynamics/model/derivatives/run_differences.hpp"
#include "dynamics/parameters.hpp"
#include "espalier/sensitivities.hpp"

namespace espalier {
namespace sensitivities_switch_test {

struct SwitchCase {
  std::string name, text;
  std::string quantity;
  struct Slope {
    std::string path;
    double value;
  };
  std::vector<Slope> slopes;
  friend void PrintTo(const SwitchCase& p, std::ostream* out) { *out << p.name; }
};

std::string mass(const std::string& parameters, const std::string& rest, const char* velocity, double end) {
  return fmt::format(
      "[parameters]\n{}[bodies.b]\ntype = \"rigid\"\nmass = 2\ninertia = [1, 1, 1]\nvelocity = [\"{}\", 0, 0]\n"
      "[joints.r]\ntype = \"prismatic\"\na = {{ body = \"ground\", axis = [1, 0, 0] }}\nb = {{ body = \"b\" }}\n{}"
      "[integrator]\nrelative = 1e-8\nabsolute = 1e-9\nend = {}\n[output]\nquantities = [\"b.position.x\"]\n",
      parameters, velocity, rest, end);
}

std::string push(const std::string& force) {
  return "[forces.f]\ntype = \"force-motor\"\na = { body = \"ground\", axis = [1, 0, 0] }\nb = { body = \"b\" }\n"
         "force = \"" +
         force + "\"\n";
}

std::vector<SwitchCase> switch_cases() {
  const std::string x = "b.position.x";
  // Free to x = 1 in 1 / v, half a period at the stop, and back: x = 1 - v (4 - 1 / v - T).
  const double k = 1e5, half = std::numbers::pi * std::sqrt(2 / k);
  SwitchCase limit{"Limit",
                   mass("k = 1e5\nv = 1\n", "limits = { upper = 1, stiffness = \"k\", smoothing = 1e-9 }\n", "v", 4),
                   x,
                   {{"parameters.k", -half / (2 * k)}, {"parameters.v", -(4 - half)}}};
  // a = force / 2 after the jump.
  SwitchCase time{"JumpInTime",
                  mass("f = 6\nt0 = 0.5\n", push("f*(1 + sign(t - t0))/2"), "0", 1),
                  x,
                  {{"parameters.f", 0.0625}, {"parameters.t0", -1.5}}};
  // The mass meets the force at x0, after x0 / v.
  SwitchCase place{"JumpInPlace",
                   mass("f = 6\nx0 = 0.5\n", push("-f*(1 + sign(r.displacement - x0))/2"), "1", 1),
                   x,
                   {{"parameters.f", -0.0625}, {"parameters.x0", 1.5}}};
  // Down in t1 = sqrt(2 h / g), up with g t1: z = 0.1 + g t1 s - g s^2 / 2, s = 0.8 - t1, h = z0 - 0.1.
  const double g = 9.81, t1 = std::sqrt(2 / g);
  SwitchCase ball{
      "Bounce",
      "gravity = [0, 0, -9.81]\n[parameters]\nz = 1.1\n[bodies.b]\ntype = \"rigid\"\nmass = 1\ninertia = [1, 1, 1]\n"
      "position = [0, 0, \"z\"]\n[surfaces.b]\nbody = \"b\"\nshape = \"sphere\"\nradius = 0.1\n[surfaces.f]\n"
      "body = \"ground\"\nshape = \"plane\"\n[contacts.c]\nsurfaces = [\"b\", \"f\"]\nstiffness = 1e9\n"
      "[integrator]\nrelative = 1e-8\nabsolute = 1e-9\nend = 0.8\n[output]\nquantities = [\"b.position.z\"]\n",
      "b.position.z",
      {{"parameters.z", (2 * g * (0.8 - t1) - g * t1) / (g * t1)}}};
  return {limit, time, place, ball};
}

class DerivativesThroughSwitches : public testing::TestWithParam<std::tuple<SwitchCase, SensitivityMethod>> {};

// The steps of the run say up to 80 times as much.
TEST_P(DerivativesThroughSwitches, AreThoseOfTheMotion) {
  const auto& [c, method] = GetParam();
  std::vector<SensitivityParameter> parameters;
  for (const auto& slope : c.slopes) parameters.push_back({slope.path});
  const SensitivityResult r = sensitivities_of_text(c.text, "model.toml", parameters, {}, method);
  ASSERT_TRUE(r.status.ok()) << r.status.message;
  for (const auto& slope : c.slopes)
    EXPECT_NEAR(r.derivative(c.quantity, slope.path), slope.value, 5e-3 * std::abs(slope.value)) << slope.path;
  const auto said = [](const std::string& notice) {
    return notice.find("by whole runs beside it") != std::string::npos;
  };
  EXPECT_TRUE(std::any_of(r.summary.notices.begin(), r.summary.notices.end(), said));
}

INSTANTIATE_TEST_SUITE_P(Methods, DerivativesThroughSwitches,
                         testing::Combine(testing::ValuesIn(switch_cases()),
                                          testing::Values(SensitivityMethod::forward, SensitivityMethod::adjoint)),
                         [](const auto& tested) {
                           return std::get<0>(tested.param).name +
                                  (std::get<1>(tested.param) == SensitivityMethod::forward ? "Forward" : "Adjoint");
                         });

// A gradient of an objective is not replaced, since the times of another run are others; it is spoken of.
TEST(DerivativesThroughSwitches, AnObjectiveThatIsContradictedIsSpokenOf) {
  const SwitchCase c = switch_cases()[1];
  const auto last = [](const std::vector<double>& t, const std::vector<double>& values, std::vector<double>& slopes) {
    slopes.back() = 1;
    return t.empty() ? 0.0 : values.back();
  };
  const SensitivityResult r =
      objective_gradient_of_text(c.text, "model.toml", {{"parameters.f"}, {"parameters.t0"}}, last, {});
  ASSERT_TRUE(r.status.ok()) << r.status.message;
  ASSERT_EQ(r.summary.notices.size(), 1U);
  EXPECT_NE(r.summary.notices[0].find("d(objective)/d(parameters.t0)"), std::string::npos) << r.summary.notices[0];
  EXPECT_NE(r.summary.notices[0].find("-1.5 by whole runs"), std::string::npos) << r.summary.notices[0];
}

// Where nothing moves the switch, no run contradicts, and nothing is said.
TEST(DerivativesThroughSwitches, WhatIsRightIsLeftAlone) {
  const SwitchCase c = switch_cases()[1];
  const SensitivityResult r = sensitivities_of_text(c.text, "model.toml", {{"parameters.f"}}, {});
  ASSERT_TRUE(r.status.ok()) << r.status.message;
  EXPECT_NEAR(r.derivative("b.position.x", "parameters.f"), 0.0625, 1e-8);
  EXPECT_TRUE(r.summary.notices.empty());
}

using dynamics::model::check_by_runs;
using dynamics::model::DerivativesToCheck;
using dynamics::model::MovedParameters;

DerivativesToCheck table(std::size_t parameters) {
  DerivativesToCheck what;
  what.numbers = {"y"};
  for (std::size_t p = 0; p < parameters; ++p) {
    what.parameters.push_back(fmt::format("p{}", p));
    what.values.push_back(1);
    what.ways.push_back(0.01);
  }
  what.noise = [](double) { return 1e-12; };
  return what;
}

/// y = sum of x_p^2 over all parameters, of 1.
std::vector<double> sum_of_squares(std::size_t parameters, const MovedParameters& moved) {
  double y = static_cast<double>(parameters);
  for (const auto& [p, x] : moved) y += x * x - 1;
  return {y};
}

TEST(DerivativesThroughSwitches, OneOfManyIsFound) {
  constexpr std::size_t kMany = 40;
  int runs = 0;
  const auto run = [&](const MovedParameters& moved) { return ++runs, sum_of_squares(kMany, moved); };
  std::vector<double> derivatives(kMany, 2.0);
  EXPECT_EQ(check_by_runs(table(kMany), run, derivatives), "");
  EXPECT_EQ(runs, 2);
  derivatives[17] = 20;
  const std::string text = check_by_runs(table(kMany), run, derivatives);
  EXPECT_NE(text.find("p17"), std::string::npos) << text;
  EXPECT_EQ(text.find("p16"), std::string::npos) << text;
  EXPECT_NEAR(derivatives[17], 2, 1e-9);
  EXPECT_EQ(derivatives[16], 2);
}

// A number that jumps has no derivative: nothing is made up.
TEST(DerivativesThroughSwitches, AJumpIsLeftAndSpokenOf) {
  const auto run = [](const MovedParameters& moved) {
    return std::vector<double>{!moved.empty() && moved[0].second > 1 ? 5.0 : 1.0};
  };
  std::vector<double> derivatives{0.5};
  const std::string text = check_by_runs(table(1), run, derivatives);
  EXPECT_NE(text.find("do not trust it"), std::string::npos) << text;
  EXPECT_EQ(derivatives[0], 0.5);
}

}  // namespace sensitivities_switch_test
}  // namespace espalier

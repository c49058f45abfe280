// Expressions of model texts. Truth: C++'s own arithmetic; derivatives against central differences.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "dynamics/model/read/expand.hpp"
#include "dynamics/model/read/expression.hpp"

namespace espalier::dynamics::model {
namespace {

TEST(ModelExpression, ValuesAreThoseOfArithmetic) {
  const Scope scope = {{"a", 3}, {"b", 0.5}};
  const double pi = std::numbers::pi;
  const std::vector<std::pair<std::string, double>> cases = {{"1 + 2*3", 7},
                                                             {"-2^2", -4},
                                                             {"2^3^2", 512},
                                                             {"(1 + 2)*3", 9},
                                                             {"7 % 4", 3},
                                                             {"-1 % 4", 3},
                                                             {"1e-3*a", 3e-3},
                                                             {"a/b", 6},
                                                             {"2^-1", 0.5},
                                                             {"--2", 2},
                                                             {"min(a, b) + max(a, b)", 3.5},
                                                             {"sin(pi/2)", 1},
                                                             {"atan2(1, -1)", 3 * pi / 4},
                                                             {"sqrt(a*a)", 3},
                                                             {"log(exp(a))", 3},
                                                             {"floor(2.7) + ceil(2.2) + round(2.5)", 8},
                                                             {"mod(-0.5, 2)", 1.5},
                                                             {"step(1, 0, 5, 2, 9)", 7},
                                                             {"step(-1, 0, 5, 2, 9)", 5},
                                                             {"ramp(3, 0, 2)", 2},
                                                             {"sign(-3)", -1},
                                                             {"abs(-a)", 3}};
  for (const auto& [text, value] : cases)
    EXPECT_NEAR(Expression(text, scope, false).value(), value, 4e-16 * std::max(1.0, std::abs(value))) << text;
}

TEST(ModelExpression, DerivativesAgreeWithDifferences) {
  const Scope scope = {{"w", 2.5}};
  for (const std::string text :
       {"sin(w*t)*cos(t)", "t^3 - 2/t", "exp(-t)*sqrt(1 + t*t)", "tan(0.3*t)", "atan(t)/(1 + t)", "atan2(t, 1 + t^2)",
        "tanh(t) + sinh(0.2*t) - cosh(0.1*t)", "asin(0.3*t) + acos(0.2*t)", "log(1 + t)", "2^t", "t^t",
        "step(t, 0.5, 1, 2, -3)", "ramp(t, 0.2, 2)", "mod(5*t, 3)", "abs(t - 9)", "max(t, 0.1*t^2)"}) {
    const Expression f(text, scope, true);
    const double t = 1.1, h = 1e-4;
    const Jet j = f.jet(t);
    const double scale = 1 + std::abs(j.value) + std::abs(j.rate) + std::abs(j.acceleration);
    // Error of the differences: h^2 times a higher derivative, and eps / h^2.
    EXPECT_NEAR(j.rate, (f.value(t + h) - f.value(t - h)) / (2 * h), 1e2 * h * h * scale) << text;
    EXPECT_NEAR(j.acceleration, (f.value(t + h) - 2 * j.value + f.value(t - h)) / (h * h),
                1e2 * h * h * scale + 1e-7 * scale)
        << text;
  }
}

TEST(ModelExpression, MistakesAreNamed) {
  const Scope scope = {{"length", 1}};
  const auto message = [&](const std::string& text) -> std::string {
    try {
      static_cast<void>(Expression(text, scope, false));
    } catch (const Error& error) {
      return error.what();
    }
    return "none";
  };
  EXPECT_NE(message("lenght*2").find("did you mean 'length'"), std::string::npos);
  EXPECT_NE(message("sine(1)").find("unknown function 'sine'"), std::string::npos);
  EXPECT_NE(message("2*t").find("unknown name 't'"), std::string::npos);  // not a function of time here
  for (const std::string text : {"", "1 +", "(1", "1)", "2 3", "sin()", "sin(1, 2)", "step(1)", "&", "1..2"})
    EXPECT_NE(message(text), "none") << text;
  EXPECT_NE(message(std::string(5000, '(')).find("nested too deeply"), std::string::npos);
}

TEST(ModelExpand, ParametersRepetitionsAndOverrides) {
  Value root = parse_toml(R"(
[parameters]
n = 3
last = "n - 1"
[[repeat]]
to = "last"
[repeat.bodies."link{i}"]
mass = "i + 1"
next = "link{(i + 1) % n}"
)",
                          "m.toml");
  expand(root, {"parameters.n=4", "bodies.extra.mass=2.5", "bodies.extra.name=plain text"});
  const Value& bodies = *root.find("bodies");
  ASSERT_EQ(bodies.entries.size(), 5U);
  EXPECT_EQ(bodies.find("link3")->find("next")->text, "link0");
  EXPECT_EQ(bodies.find("extra")->find("mass")->real, 2.5);
  EXPECT_EQ(bodies.find("extra")->find("name")->text, "plain text");
  EXPECT_EQ(root.find("parameters"), nullptr);
  EXPECT_EQ(root.find("repeat"), nullptr);
}

}  // namespace
}  // namespace espalier::dynamics::model

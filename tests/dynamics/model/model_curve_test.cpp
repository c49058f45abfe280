// Splines. Truth: polynomials that the kinds reproduce, continuity at the points, finite differences, and bounds.
#include <gtest/gtest.h>

#include <cmath>

#include "dynamics/model/build/curve.hpp"
#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics::model {
namespace {

using Kind = Curve::Kind;
using Outside = Curve::Outside;
constexpr Kind kAll[] = {Kind::linear, Kind::akima, Kind::monotone, Kind::cubic};

Curve through(double (*f)(double), const std::vector<double>& x, Kind kind, Outside outside = Outside::linear) {
  std::vector<double> y;
  for (const double at : x) y.push_back(f(at));
  return {"c", x, y, kind, outside};
}

const std::vector<double> kUneven = {-2, -1.2, -1, 0.3, 0.8, 2, 3.5};

TEST(Curve, PassesThroughItsPointsAndDerivativesAgreeWithDifferences) {
  for (const Kind kind : kAll) {
    const Curve c = through([](double x) { return std::sin(2 * x) + x; }, kUneven, kind);
    for (const double x : kUneven) EXPECT_NEAR(c.at(x).y, std::sin(2 * x) + x, 1e-14);
    for (double x = -2.5; x < 4; x += 0.0937) {
      const double h = 1e-5;
      EXPECT_NEAR(c.at(x).slope, (c.at(x + h).y - c.at(x - h).y) / (2 * h), 1e-8) << x;
      EXPECT_NEAR(c.at(x).bend, (c.at(x + h).slope - c.at(x - h).slope) / (2 * h), 1e-8) << x;
    }
  }
}

TEST(Curve, LinesAreReproducedByAllAndParabolasByAkima) {
  const std::vector<double> even = {0, 1, 2, 3, 4, 5};
  for (double x = -1; x < 6; x += 0.17) {
    for (const Kind kind : kAll)
      EXPECT_NEAR(through([](double u) { return 3 - 2 * u; }, kUneven, kind).at(x).y, 3 - 2 * x, 1e-13);
    if (x >= 0 && x <= 5) {
      EXPECT_NEAR(through([](double u) { return u * u - u; }, even, Kind::akima).at(x).y, x * x - x, 1e-12);
    }
  }
}

TEST(Curve, NaturalSplineHasContinuousBendThatEndsInZero) {
  const Curve c = through([](double x) { return std::exp(x); }, kUneven, Kind::cubic);
  for (std::size_t i = 1; i + 1 < kUneven.size(); ++i)
    EXPECT_NEAR(c.at(kUneven[i] - 1e-9).bend, c.at(kUneven[i] + 1e-9).bend, 1e-6);
  EXPECT_NEAR(c.at(-2).bend, 0, 1e-12);
  EXPECT_NEAR(c.at(3.5).bend, 0, 1e-12);
}

TEST(Curve, MonotoneOnesDoNotOvershoot) {
  const Curve c("c", {0, 1, 2, 3, 4, 5}, {0, 0, 0, 1, 1, 1}, Kind::monotone, Outside::constant);
  double before = 0;
  for (double x = 0; x <= 5; x += 0.01) {
    EXPECT_GE(c.at(x).y, before - 1e-15);
    EXPECT_LE(c.at(x).y, 1 + 1e-15);
    before = c.at(x).y;
  }
}

TEST(Curve, GoesOnOutsideAsAsked) {
  const auto f = [](double x) { return x * x; };
  EXPECT_EQ(through(f, kUneven, Kind::linear, Outside::constant).at(9).y, 3.5 * 3.5);
  EXPECT_EQ(through(f, kUneven, Kind::linear, Outside::constant).at(9).slope, 0);
  EXPECT_NEAR(through(f, kUneven, Kind::linear).at(4.5).y, 12.25 + 5.5, 1e-12);
  EXPECT_THROW(static_cast<void>(through(f, kUneven, Kind::akima, Outside::error).at(3.6)), Error);
  EXPECT_THROW(Curve("c", {0, 1, 1}, {0, 0, 0}, Kind::linear, Outside::error), std::invalid_argument);
  EXPECT_THROW(Curve("c", {0}, {0}, Kind::linear, Outside::error), std::invalid_argument);
}

TEST(Curve, ColumnsOfACsvFileBecomeAForce) {
  // A cart on a spring whose force stands in a table (a line: the closed form is a cosine).
  const ScratchFolder folder;
  std::ofstream(folder.path() + "/spring.csv")
      << "# measured\nforce [N];\"travel [mm]\"\r\n-200;-1000\r\n+0;0\r\n200;1e3\r\n";
  std::ofstream(folder.path() + "/model.toml") << R"toml([splines.law]
file = "spring.csv"
x = "travel [mm]"
y = 1
x_scale = 1e-3
kind = "cubic"
[bodies.cart]
type = "rigid"
mass = 2
box = [0.1, 0.1, 0.1]
position = [0.8, 0, 0]
[forces.spring]
type = "axial-spring"
a = { body = "ground", axis = [1, 0, 0] }
b = { body = "cart" }
actuator = "law(spring.coordinate)"
[integrator]
relative = 1e-10
absolute = 1e-11
end = 0.4
)toml";
  Simulation s;
  const Status status = s.load(folder.path() + "/model.toml");
  ASSERT_TRUE(status.ok()) << status.message;
  ASSERT_TRUE(s.run().ok());
  EXPECT_NEAR(s.value("cart.position.x"), 0.8 * std::cos(10 * 0.4), 1e-8);
}

}  // namespace
}  // namespace espalier::dynamics::model

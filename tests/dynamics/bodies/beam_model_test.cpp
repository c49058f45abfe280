// Beams of model texts: axes by curvature and through points, and what is wrong with them.
#include <cmath>
#include <numbers>

#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace {

/// A beam at rest without gravity for one short step; its last node is the marker "end".
std::string at_rest(const std::string& axis) {
  return R"(
[bodies.arm]
type = "beam"
elements = 12
radius = 0.01
material = { young = 2e9, poisson = 0.3, density = 1000 }
)" + axis +
         R"(
[joints.wall]
type = "fixed"
a = { body = "ground", point = [1, 2, 3] }
b = { body = "arm", node = 1 }
[markers.end]
body = "arm"
node = -1
[markers.middle]
body = "arm"
node = 7
[integrator]
end = 1e-3
)";
}

void expect_at(const Simulation& s, const std::string& marker, double x, double y, double z, double tolerance) {
  EXPECT_NEAR(s.value(marker + ".position.x"), x, tolerance) << marker;
  EXPECT_NEAR(s.value(marker + ".position.y"), y, tolerance) << marker;
  EXPECT_NEAR(s.value(marker + ".position.z"), z, tolerance) << marker;
}

// Truth: a quarter circle of radius 2 about z; a helix of radius r and slope c, whose curvature is r / (r^2 + c^2) and
// whose torsion c / (r^2 + c^2).
TEST(BeamModel, AxisByCurvature) {
  const Simulation arc = simulated(at_rest(R"(start = [1, 2, 3]
direction = [1, 0, 0]
length = "pi"
curvature = [0, 0, 0.5])"));
  expect_at(arc, "end", 3, 4, 3, 1e-9);
  expect_at(arc, "middle", 1 + std::numbers::sqrt2, 4 - std::numbers::sqrt2, 3, 1e-9);
  // r = 0.6, c = 0.8: unit length per radian. The axis starts at (r, 0, 0) along (0, r, c); towards the centre: -x.
  const Simulation helix = simulated(at_rest(R"(start = [1, 2, 3]
direction = [0, 0.6, 0.8]
y = [-1, 0, 0]
length = 2
curvature = [0.8, 0, 0.6])"));
  expect_at(helix, "end", 1 + 0.6 * (std::cos(2.0) - 1), 2 + 0.6 * std::sin(2.0), 3 + 0.8 * 2, 1e-9);
}

// Truth: the quarter circle. A cubic spline through points of it is off by their distance to the fourth power over 384,
// relative to the radius: 9 points, 4e-6; at its ends somewhat more.
TEST(BeamModel, AxisThroughPoints) {
  std::string points;
  for (int k = 0; k <= 8; ++k) {
    const double a = 0.0625 * std::numbers::pi * k;
    points += "[" + std::to_string(1 + 2 * std::sin(a)) + ", " + std::to_string(4 - 2 * std::cos(a)) + ", 3], ";
  }
  const Simulation arc = simulated(at_rest("points = [" + points + "]"));
  expect_at(arc, "end", 3, 4, 3, 2e-6);
  expect_at(arc, "middle", 1 + std::numbers::sqrt2, 4 - std::numbers::sqrt2, 3, 2e-5);
}

TEST(BeamModel, MistakesAreNamed) {
  const auto message = [](const std::string& axis) {
    Simulation s;
    Status status = s.load_text(at_rest(axis), "model.toml");
    if (status.ok()) status = s.run();
    return status.message;
  };
  EXPECT_NE(message("points = [[0, 0, 0], [1, 0, 0]]\nend = [1, 0, 0]").find("does not go with 'points'"),
            std::string::npos);
  EXPECT_NE(message("start = [0, 0, 0]\nend = [1, 0, 0]\ncurvature = [0, 0, 1]").find("does not go with 'curvature'"),
            std::string::npos);
  EXPECT_NE(message("points = [[0, 0, 0], [0, 0, 0], [1, 0, 0]]").find("points 1 and 2 of the axis coincide"),
            std::string::npos);
  EXPECT_NE(message("points = [[0, 0, 0]]").find("two points at least"), std::string::npos);
  EXPECT_NE(message("start = [1, 1, 1]\nend = [1, 1, 1]").find("the ends of the beam coincide"), std::string::npos);
  EXPECT_NE(message("start = [0, 0, 0]\nend = [1, 0, 0]\ny = [2, 0, 0]").find("y direction lies along the axis"),
            std::string::npos);
  EXPECT_NE(message("start = [0, 0, 0]\ndirection = [0, 0, 0]\nlength = 1\ncurvature = [0, 0, 1]").find("no direction"),
            std::string::npos);
}

}  // namespace
}  // namespace espalier::dynamics

// BDF's tolerance is refined: errors of position, velocity and reaction fall with it until round-off. Truth: the
// pendulum's own equation, phi'' = -g / l sin phi, by Runge and Kutta's method in 200,000 steps.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace refinement_tolerance_test {

constexpr double kG = 10, kMass = 2, kEnd = 1.3;

/// Angle from below and its speed at kEnd, released at rest from the horizontal, length 1.
std::array<double, 2> truth() {
  constexpr int kSteps = 200000;
  const long double h = static_cast<long double>(kEnd) / kSteps;
  const auto rate = [](long double angle) { return -static_cast<long double>(kG) * std::sin(angle); };
  long double angle = std::acos(-1.0L) / 2, speed = 0;
  for (int k = 0; k < kSteps; ++k) {
    const long double v1 = speed, a1 = rate(angle);
    const long double v2 = speed + h / 2 * a1, a2 = rate(angle + h / 2 * v1);
    const long double v3 = speed + h / 2 * a2, a3 = rate(angle + h / 2 * v2);
    const long double v4 = speed + h * a3, a4 = rate(angle + h * v3);
    angle += h / 6 * (v1 + 2 * v2 + 2 * v3 + v4);
    speed += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
  }
  return {static_cast<double>(angle), static_cast<double>(speed)};
}

std::string pendulum(double tolerance) {
  return fmt::format(R"(gravity = [0, 0, -10]
[bodies.bob]
type = "point"
mass = 2
position = [1, 0, 0]
[joints.rod]
type = "distance"
a = {{ body = "ground" }}
b = {{ body = "bob" }}
[integrator]
relative = {0}
absolute = {0}
absolute_velocity = {0}
constraint_tolerance = 1e-13
end = 1.3
)",
                     tolerance);
}

TEST(Refinement, BdfsTolerance) {
  const auto [angle, speed] = truth();
  const double pull = kMass * (kG * std::cos(angle) + speed * speed);
  struct Error {
    const char* name;
    double floor, before;
  };
  std::array<Error, 3> errors = {{{"position", 1e-11, 1e300}, {"velocity", 2e-10, 1e300}, {"reaction", 1e-9, 1e300}}};
  for (const double tolerance : {1e-4, 1e-6, 1e-8, 1e-10, 1e-12}) {
    const Simulation s = simulated(pendulum(tolerance));
    const double now[] = {
        std::hypot(s.value("bob.position.x") - std::sin(angle), s.value("bob.position.z") + std::cos(angle)),
        std::hypot(s.value("bob.velocity.x") - speed * std::cos(angle),
                   s.value("bob.velocity.z") - speed * std::sin(angle)),
        std::abs(s.value("rod.force.norm") - std::abs(pull))};
    fmt::print("{:.0e}: {} steps, errors {:.1e} {:.1e} {:.1e}\n", tolerance, s.summary().steps, now[0], now[1], now[2]);
    for (std::size_t k = 0; k < errors.size(); ++k) {
      Error& e = errors[k];
      EXPECT_LT(now[k], std::max(e.before / 10, e.floor)) << e.name << " at " << tolerance;
      EXPECT_LT(now[k], std::max(3000 * tolerance, e.floor)) << e.name << " at " << tolerance;
      e.before = now[k];
    }
  }
}

}  // namespace refinement_tolerance_test
}  // namespace espalier::dynamics

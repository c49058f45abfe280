// Reactions of a mechanism whose motors say all of its motion. Truth: the inverse dynamics of an arm with two links
// (any book on robots, for instance Spong, Hutchinson, Vidyasagar, Robot Modeling and Control, 2006, section 7.4).
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace driven_mechanism_test {

constexpr double kUpper = 0.5, kFore = 0.4, kUpperMass = 3, kForeMass = 2, kWidth = 0.05, kGravity = 9.81;

std::string arm(const std::string& integrator) {
  return R"toml(
gravity = [0, -9.81, 0]
[bodies.upper]
type = "rigid"
mass = 3
box = [0.5, 0.05, 0.05]
position = [0.25, 0, 0]
[bodies.fore]
type = "rigid"
mass = 2
box = [0.4, 0.05, 0.05]
position = [0.7, 0, 0]
[joints]
shoulder = { type = "revolute", bodies = ["ground", "upper"], at = [0, 0, 0], axis = [0, 0, 1] }
elbow = { type = "revolute", bodies = ["upper", "fore"], at = [0.5, 0, 0], axis = [0, 0, 1] }
shoulder_drive = { type = "rotation-motor", bodies = ["ground", "upper"], at = [0, 0, 0], axis = [0, 0, 1], motion = "0.8*(1 - cos(2*t))" }
elbow_drive = { type = "rotation-motor", bodies = ["upper", "fore"], at = [0.5, 0, 0], axis = [0, 0, 1], motion = "-0.6*(1 - cos(3*t))" }
[output]
quantities = ["shoulder_drive.moment.z", "elbow_drive.moment.z"]
[integrator]
end = 2
)toml" + integrator;
}

struct Torques {
  double shoulder, elbow;
};

Torques torques(double t) {
  const double a1 = 0.8 * (1 - std::cos(2 * t)), w1 = 1.6 * std::sin(2 * t), e1 = 3.2 * std::cos(2 * t);
  const double a2 = -0.6 * (1 - std::cos(3 * t)), w2 = -1.8 * std::sin(3 * t), e2 = -5.4 * std::cos(3 * t);
  const double c1 = kUpper / 2, c2 = kFore / 2;
  const double i1 = kUpperMass * (kUpper * kUpper + kWidth * kWidth) / 12;
  const double i2 = kForeMass * (kFore * kFore + kWidth * kWidth) / 12;
  const double coupling = kForeMass * kUpper * c2;
  const double m22 = i2 + kForeMass * c2 * c2, m12 = m22 + coupling * std::cos(a2);
  const double m11 = i1 + kUpperMass * c1 * c1 + kForeMass * kUpper * kUpper + m12 + coupling * std::cos(a2);
  const double turning = coupling * std::sin(a2);
  const double lower = kForeMass * kGravity * c2 * std::cos(a1 + a2);
  const double upper = (kUpperMass * c1 + kForeMass * kUpper) * kGravity * std::cos(a1);
  return {m11 * e1 + m12 * e2 - turning * (2 * w1 * w2 + w2 * w2) + upper + lower,
          m12 * e1 + m22 * e2 + turning * w1 * w1 + lower};
}

/// The largest error of both torques over the run, relative to the largest torque.
double error_of(const std::string& integrator) {
  SimulationOptions options;
  options.keep_series = true;
  double worst = 0, largest = 0;
  const Simulation s = simulated(arm(integrator), options);
  const SimulationSeries& series = s.series();
  for (std::size_t k = 0; k < series.t.size(); ++k) {
    const Torques truth = torques(series.t[k]);
    largest = std::max({largest, std::abs(truth.shoulder), std::abs(truth.elbow)});
    worst = std::max(
        {worst, std::abs(series.values[2 * k] - truth.shoulder), std::abs(series.values[2 * k + 1] - truth.elbow)});
  }
  EXPECT_GT(series.t.size(), 20U);
  return worst / largest;
}

// One pass of Newton's iteration knows q and v, but left 2e-4 of the torques wrong at 1e-6.
TEST(DrivenMechanism, ReactionsAreThoseOfInverseDynamics) {
  for (const double tolerance : {1e-3, 1e-5, 1e-6, 1e-8})
    EXPECT_LT(error_of(fmt::format("relative = {0}\nabsolute = {0}\n", tolerance)), 5 * tolerance);
  EXPECT_LT(error_of("step = 0.02\norder = 2\n"), 1e-7);
  EXPECT_LT(error_of("method = \"generalized-alpha\"\nstep = 0.002\n"), 1e-4);
}

}  // namespace driven_mechanism_test
}  // namespace espalier::dynamics

// Damping by ratio, Rayleigh's and structural damping: modes, free motions and frequency responses, nodal and reduced.
#include "dynamics/model/model_common.hpp"
#include "dynamics/model/model_harmonic_common.hpp"

namespace espalier::dynamics {
namespace damping_test {

using test::kTwoPi;

/// A clamped beam; `damping` may be any keys of the body.
std::string clamped_beam(const std::string& damping, const std::string& rest) {
  return fmt::format(R"(
[bodies.beam]
type = "beam"
start = [0, 0, 0]
end = [1, 0, 0]
elements = 4
material = {{ young = 7e10, poisson = 0.33, density = 2700 }}
height = 0.01
width = 0.02
{}
[joints.wall]
type = "fixed"
a = {{ body = "ground" }}
b = {{ body = "beam", node = 1 }}
[forces.shaker]
type = "load"
a = {{ body = "beam", node = -1 }}
force = [0, 1, 0]
factor = 0
[markers]
tip = {{ body = "beam", node = -1 }}
{}
)",
                     damping, rest);
}

std::vector<SimulationMode> modes_of(const std::string& damping) {
  const Simulation s = simulated(clamped_beam(damping, "[initial]\nmodes = 4\n[statics]\n"));
  return s.summary().modes;
}

// The issue's case: 2 % on a reduced plate gave half of it.
TEST(Damping, RatioIsThatOfEachModeOfTheSupportedModel) {
  for (const char* damping : {"damping = { ratio = 0.02 }", "reduce = { modes = 8, damping = 0.02 }",
                              "reduce = { modes = 8 }\ndamping = { ratio = 0.02 }"})
    for (const SimulationMode& mode : modes_of(damping)) EXPECT_NEAR(mode.damping_ratio, 0.02, 2e-6) << damping;
  const std::string plate = R"(
[bodies.plate]
type = "solid"
mesh = { part = "block", lx = 0.4, ly = 0.3, lz = 0.01, divisions = [8, 6, 1] }
material = { young = 7e10, poisson = 0.3, density = 2700 }
hex8 = "shell"
DAMPING
[joints.wall]
type = "fixed"
a = { body = "ground" }
b = { body = "plate", face = "x0", attach = "mean" }
[initial]
modes = 4
[statics]
)";
  for (const char* damping : {"damping = { ratio = 0.02 }", "reduce = { modes = 20, damping = 0.02 }"}) {
    const Simulation s = simulated(replaced(plate, "DAMPING", damping));
    ASSERT_EQ(s.summary().modes.size(), 4U);
    for (const SimulationMode& mode : s.summary().modes) EXPECT_NEAR(mode.damping_ratio, 0.02, 2e-5) << damping;
  }
}

TEST(Damping, RayleighByRatiosAtTwoFrequencies) {
  const std::vector<SimulationMode> undamped = modes_of("");
  for (const char* reduce : {"", "reduce = { modes = 8 }"}) {
    const std::vector<SimulationMode> found =
        modes_of(fmt::format("damping = {{ ratio = [0.02, 0.03], frequencies = [{:.12g}, {:.12g}] }}\n{}",
                             undamped[0].frequency, undamped[2].frequency, reduce));
    EXPECT_NEAR(found[0].damping_ratio, 0.02, 2e-5) << reduce;
    EXPECT_NEAR(found[2].damping_ratio, 0.03, 2e-5) << reduce;
  }
}

// l = i w sqrt(1 + i eta)
TEST(Damping, StructuralInModes) {
  const double eta = 0.1, ratio = std::sin(0.5 * std::atan(eta));
  for (const char* reduce : {"", "reduce = { modes = 8 }\n"})
    for (const SimulationMode& mode : modes_of(std::string(reduce) + "damping = { loss_factor = 0.1 }"))
      EXPECT_NEAR(mode.damping_ratio, ratio, 1e-8) << reduce;
}

ModelHarmonicResult swept(const std::string& damping, const std::string& frequencies, const std::string& more = "") {
  return test::responded(clamped_beam(
      damping,
      fmt::format("[harmonic]\n{}\nloads = [\"shaker\"]\nquantities = [\"tip.position.y\"]\n{}", frequencies, more)));
}

// The damping of the body alone or of all stiffness: the same, as there is no other.
TEST(Damping, StructuralInResponses) {
  const char* const frequencies = "frequencies = [3, 8.2, 40, 51.5]";
  const ModelHarmonicResult whole = swept("", frequencies, "loss_factor = 0.05");
  for (const char* damping : {"damping = { loss_factor = 0.05 }", "damping = { loss_factor = 0.05, frequency = 9 }",
                              "damping = { loss_factor = 0.05 }\nreduce = { modes = 10 }"}) {
    const ModelHarmonicResult own = swept(damping, frequencies);
    ASSERT_TRUE(own.status.ok()) << own.status.message;
    const double near = std::string(damping).find("reduce") == std::string::npos ? 1e-7 : 1e-3;
    for (std::size_t k = 0; k < 4; ++k) {
      const test::Complex a = test::value_of(whole, k, "tip.position.y"), b = test::value_of(own, k, "tip.position.y");
      EXPECT_LE(std::abs(a - b), near * std::abs(a)) << damping << " " << k;
    }
  }
}

/// Half of the width of the first peak over its frequency, where it has fallen to 1 / sqrt 2.
double half_power_ratio(const std::string& damping) {
  const double f = modes_of(damping)[0].frequency;
  const int points = 801;
  const ModelHarmonicResult r =
      swept(damping, fmt::format("from = {}\nto = {}\npoints = {}", 0.95 * f, 1.05 * f, points));
  EXPECT_TRUE(r.status.ok()) << r.status.message;
  std::vector<double> square;
  for (int k = 0; k < points; ++k)
    square.push_back(std::norm(test::value_of(r, static_cast<std::size_t>(k), "tip.position.y")));
  const double half = *std::max_element(square.begin(), square.end()) / 2, step = 0.1 * f / (points - 1);
  double crossing[2] = {0, 0};
  int found = 0;
  for (std::size_t k = 0; k + 1 < square.size() && found < 2; ++k)
    if ((square[k] < half) != (square[k + 1] < half))
      crossing[found++] = (static_cast<double>(k) + (half - square[k]) / (square[k + 1] - square[k])) * step;
  EXPECT_EQ(found, 2);
  return (crossing[1] - crossing[0]) / (2 * f);
}

TEST(Damping, WidthsOfPeaks) {
  for (const char* damping :
       {"damping = { ratio = 0.01 }", "reduce = { modes = 8, damping = 0.01 }", "damping = { loss_factor = 0.02 }"})
    EXPECT_NEAR(half_power_ratio(damping), 0.01, 1e-4) << damping;
}

/// From the maxima of a mass on the beam's end that is let go: ln(x1 / x2) = 2 pi z / sqrt(1 - z^2).
double decay_ratio(const std::string& damping) {
  SimulationOptions options;
  options.keep_series = true;
  const Simulation s = simulated(clamped_beam(damping, R"toml(
[bodies.mass]
type = "rigid"
mass = 5
box = [0.02, 0.02, 0.02]
position = [1, 0, 0]
[joints.weld]
type = "fixed"
a = { body = "beam", node = -1 }
b = { body = "mass" }
[forces.held]
type = "load"
a = { body = "mass" }
force = [0, 1, 0]
factor = "1 - step(t, 0, 0, 0.2, 1)"
[initial]
statics = true
[integrator]
method = "generalized-alpha"
spectral_radius = 0.9
step = 5e-3
end = 2
[output]
quantities = ["mass.position.y"]
)toml"),
                                 options);
  const std::vector<double>&t = s.series().t, &y = s.series().values;
  std::vector<double> maxima;
  for (std::size_t k = 1; k + 1 < y.size(); ++k)
    if (t[k] > 0.25 && y[k] > y[k - 1] && y[k] >= y[k + 1]) {  // of the parabola through three points
      const double slope = y[k + 1] - y[k - 1], bend = y[k + 1] - 2 * y[k] + y[k - 1];
      maxima.push_back(y[k] - slope * slope / (8 * bend));
    }
  EXPECT_GE(maxima.size(), 2U);
  const double decrement = std::log(maxima[0] / maxima.back()) / static_cast<double>(maxima.size() - 1);
  return decrement / std::hypot(decrement, kTwoPi);
}

TEST(Damping, DecayOfAFreeMotion) {
  EXPECT_NEAR(decay_ratio("damping = { ratio = 0.03 }"), 0.03, 3e-5);
  EXPECT_NEAR(decay_ratio("reduce = { modes = 4, damping = 0.03 }"), 0.03, 3e-5);
  // The same, by viscous damping that is right at the frequency of this motion.
  const double f = std::sqrt(3 * 7e10 * 0.02 * 1e-6 / 12 / (5 + 0.24 * 0.54)) / kTwoPi;
  EXPECT_NEAR(decay_ratio(fmt::format("damping = {{ loss_factor = 0.06, frequency = {} }}", f)), 0.03, 1e-4);
}

// Elastic forces do no work in rigid motion: what there is of it is that of the beam without damping (of which the
// steps lose some).
TEST(Damping, RatioLeavesRigidMotionAlone) {
  const auto spinning = [](const std::string& damping) {
    return simulated(R"(
[bodies.beam]
type = "beam"
start = [-0.5, 0, 0]
end = [0.5, 0, 0]
elements = 2
material = { young = 7e10, poisson = 0.33, density = 2700 }
height = 0.02
width = 0.02
angular_velocity = [0, 0, 3]
velocity = [1, 0, 0]
)" + damping + R"(
[integrator]
method = "generalized-alpha"
step = 5e-3
end = 1
)");
  };
  const double momentum = spinning("").value("beam.angular_momentum.z"), inertia = 2700 * 4e-4 * (1 + 4e-4) / 12;
  EXPECT_NEAR(momentum, 3 * inertia, 1e-3 * inertia);
  EXPECT_NEAR(spinning("damping = { ratio = 0.2 }").value("beam.angular_momentum.z"), momentum, 5e-5 * momentum);
  EXPECT_NEAR(spinning("reduce = { modes = 6, damping = 0.2 }").value("beam.angular_momentum.z"), 3 * inertia,
              1e-5 * momentum);
}

TEST(Damping, GoesOnAfterARestart) {
  const std::string text = clamped_beam("damping = { ratio = 0.02 }", R"(
[forces.push]
type = "load"
a = { body = "beam", node = -1 }
force = [0, 5, 0]
[integrator]
method = "generalized-alpha"
step = 1e-3
end = 0.02
)");
  Simulation first, second;
  ASSERT_TRUE(first.load_text(text, "model.toml").ok());
  ASSERT_TRUE(first.step_to(0.01).ok());
  const std::string state = first.save();
  ASSERT_TRUE(first.run().ok());
  ASSERT_TRUE(second.load_text(text, "model.toml").ok());
  ASSERT_TRUE(second.restore(state).ok());
  ASSERT_TRUE(second.run().ok());
  EXPECT_EQ(first.value("tip.position.y"), second.value("tip.position.y"));
}

TEST(Damping, RefusalsSayWhatToDo) {
  const auto refused = [](const std::string& damping, const std::string& run, const std::string& word) {
    Simulation s;
    const Status status = s.load_text(clamped_beam(damping, run), "model.toml");
    EXPECT_FALSE(status.ok()) << damping;
    EXPECT_NE(status.message.find(word), std::string::npos) << status.message;
  };
  const char* const motion = "[integrator]\nend = 1\n";
  refused("damping = { ratio = 2 }", motion, "0.02");
  refused("damping = { ratio = -0.1 }", motion, "at least 0");
  refused("damping = { frequencies = [1, 2] }", motion, "needs 'ratio'");
  refused("damping = { ratio = 0.02, frequencies = [1] }", motion, "two numbers");
  refused("damping = { ratio = 0.02, frequencies = [2, 1] }", motion, "lower one first");
  refused("damping = { ratio = [0.02, 0.5], frequencies = [10, 12] }", motion, "lies between");
  refused("damping = { ratio = 0.02, frequencies = [1, 2], mass = 1 }", motion, "leave it out");
  refused("damping = { loss_factor = 0.02 }", motion, "'frequency'");
  refused("damping = { frequency = 3 }", motion, "loss_factor");
  refused("damping = { ratio = 0.02 }\nreduce = { modes = 3, damping = 0.02 }", motion, "give one of them");
  refused("damping = { ratoi = 0.02 }", motion, "ratio");
  Simulation large;
  const Status status = large.load_text(R"(
[bodies.block]
type = "solid"
mesh = { part = "block", lx = 1, ly = 1, lz = 1, divisions = [7, 7, 7] }
material = { young = 7e10, poisson = 0.3, density = 2700 }
damping = { ratio = 0.02 }
[integrator]
end = 1
)",
                                        "model.toml");
  EXPECT_NE(status.message.find("reduce = { modes"), std::string::npos) << status.message;
}

TEST(Damping, LoadedNodesOfAReducedBodyAreANotice) {
  std::string loads;
  for (int k = 2; k < 6; ++k)
    loads +=
        fmt::format("[forces.p{0}]\ntype = \"load\"\na = {{ body = \"beam\", node = {0} }}\nforce = [0, 1, 0]\n", k);
  const Simulation s = simulated(clamped_beam("reduce = { modes = 2 }", loads + "[statics]\n"));
  const std::vector<std::string>& all = s.summary().notices;
  EXPECT_TRUE(std::any_of(all.begin(), all.end(), [](const std::string& notice) {
    return notice.find("nodes that forces act on is an interface") != std::string::npos;
  }));
}

}  // namespace damping_test
}  // namespace espalier::dynamics

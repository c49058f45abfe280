// Frequency responses of models against beams in closed form, under refinement of the mesh, and against the steady
// state of motions, under refinement of the step.
#include "dynamics/model/model_common.hpp"
#include "dynamics/model/model_harmonic_common.hpp"

namespace espalier::dynamics {
namespace {

using test::Complex;
using test::kI;
using test::kTwoPi;
using test::responded;
using test::value_of;

double worst_of(const ModelHarmonicResult& r, const std::function<Complex(double)>& truth) {
  EXPECT_TRUE(r.status.ok()) << r.status.message;
  double worst = 0;
  for (std::size_t p = 0; p < r.response.points.size(); ++p) {
    const Complex exact = truth(kTwoPi * r.response.points[p].frequency);
    worst = std::max(worst, std::abs(value_of(r, p, "tip.position.z") - exact) / std::abs(exact));
  }
  return worst;
}

// Beam elements: over the first two resonances, with a loss factor. The wire is so thin that shear and the inertia of
// turning sections, which the closed form leaves out, are 1e-3 even in a resonance.
TEST(ModelHarmonicTruth, ACantileverOfBeamElementsConvergesToTheClosedForm) {
  constexpr double kEta = 0.02, kRadius = 0.001;
  const double ei = 2e11 * std::numbers::pi / 4 * std::pow(kRadius, 4),
               mass = 7800 * std::numbers::pi * kRadius * kRadius;
  const auto truth = [&](double w) { return test::cantilever_compliance(ei * Complex(1, kEta), mass, w); };
  std::vector<double> errors;
  for (const int elements : {4, 8, 16}) {
    errors.push_back(worst_of(responded(test::cantilever(elements, kEta, "", kRadius) +
                                        "from = 0.2\nto = 12\npoints = 40\nloads = [\"shaker\"]\n"
                                        "quantities = [\"tip.position.z\"]\n"),
                              truth));
    std::printf("beam, %d elements: %.2e\n", elements, errors.back());
  }
  EXPECT_LT(errors[1], 0.5 * errors[0]);
  EXPECT_LT(errors[2], 0.5 * errors[1]);
  EXPECT_LT(errors[2], 5e-3);
}

// Solid elements, below the first resonance, with damping of the material; the closed form with E (1 + i w b). What is
// left is shear, (h / L)^2, and what the clamp does.
TEST(ModelHarmonicTruth, ACantileverOfSolidsConvergesToTheClosedForm) {
  constexpr double kHeight = 0.02, kDamping = 1e-4;
  const double ei = 2e11 * std::pow(kHeight, 4) / 12, mass = 7800 * kHeight * kHeight;
  const auto truth = [&](double w) { return test::cantilever_compliance(ei * (1.0 + kI * w * kDamping), mass, w); };
  std::vector<double> errors;
  for (const int n : {4, 8, 16}) {
    errors.push_back(worst_of(responded(fmt::format(R"(
[bodies.arm]
type = "solid"
mesh = {{ part = "block", lx = 1.0, ly = 0.02, lz = 0.02, divisions = [{}, 1, 1] }}
material = {{ young = 2e11, poisson = 0, density = 7800 }}
damping = {{ stiffness = 1e-4 }}
[joints.wall]
type = "fixed"
a = {{ body = "ground" }}
b = {{ body = "arm", face = "x0" }}
[markers.tip]
body = "arm"
face = "x1"
[forces.shaker]
type = "load"
a = "tip"
force = [0, 0, 1]
factor = 0
[harmonic]
from = 1
to = 10
points = 10
loads = ["shaker"]
quantities = ["tip.position.z"]
)",
                                                    n)),
                              truth));
    std::printf("solid, %d elements: %.2e\n", n, errors.back());
  }
  EXPECT_LT(errors[1], 0.5 * errors[0]);
  EXPECT_LT(errors[2], 0.6 * errors[1]);
  EXPECT_LT(errors[2], 1e-2);
}

// The complex amplitude of one quantity over the last of so many periods, of equal steps.
Complex steady(const std::string& text, const std::string& quantity, double frequency, int periods, int steps) {
  SimulationOptions o;
  o.keep_series = true;
  o.quantities = {quantity};
  o.solver = {{"threads", "1"}};
  o.set = {fmt::format("integrator.step={:.17g}", 1 / (frequency * steps)),
           fmt::format("integrator.end={:.17g}", periods / frequency)};
  const Simulation simulation = simulated(text, o);
  const SimulationSeries& s = simulation.series();
  EXPECT_EQ(s.t.size(), static_cast<std::size_t>(periods * steps) + 1);
  Complex sum = 0;
  for (std::size_t k = s.t.size() - static_cast<std::size_t>(steps); k < s.t.size(); ++k)
    sum += s.values[k] * std::exp(-kI * (kTwoPi * frequency * s.t[k]));
  return 2.0 * sum / static_cast<double>(steps);
}

void expect_steady_state(const std::string& text, const std::string& quantity, double frequency, int periods,
                         const char* name) {
  const ModelHarmonicResult r = responded(text + fmt::format("[harmonic]\nfrequencies = [{}]\nloads = [\"shaker\"]\n"
                                                             "quantities = [\"{}\"]\n",
                                                             frequency, quantity));
  ASSERT_TRUE(r.status.ok()) << r.status.message;
  const Complex truth = value_of(r, 0, quantity);
  std::vector<double> errors;
  for (const int steps : {20, 40, 80}) {
    const Complex y = steady(text, quantity, frequency, periods, steps);
    errors.push_back(std::abs(y - truth) / std::abs(truth));
    std::printf("%s, %s, %d steps a period: %.2e (amplitude %.6g, phase %.3f degrees; harmonic %.6g, %.3f)\n", name,
                quantity.c_str(), steps, errors.back(), std::abs(y), std::arg(y) * 180 / std::numbers::pi,
                std::abs(truth), std::arg(truth) * 180 / std::numbers::pi);
  }
  // Generalized-alpha is of second order.
  EXPECT_NEAR(errors[0] / errors[1], 4, 0.7);
  EXPECT_NEAR(errors[1] / errors[2], 4, 0.7);
  EXPECT_LT(errors[2], 3e-3);
}

// A pendulum with a damper in its hinge, pushed near its resonance; motions are so small that it is linear to 1e-7.
TEST(ModelHarmonicTruth, IsTheSteadyStateOfAPendulum) {
  const std::string text = R"toml(
gravity = [0, 0, -10]
[parameters]
w = "2*pi*0.5"
[bodies.bob]
type = "rigid"
mass = 2
inertia = [0.01, 0.01, 0.01]
position = [0, 0, -1]
[joints.hinge]
type = "revolute"
a = { body = "ground", axis = [0, 1, 0] }
b = { body = "bob", point = [0, 0, 1], axis = [0, 1, 0] }
[forces.damper]
type = "rotational-spring"
a = { body = "ground", axis = [0, 1, 0] }
b = { body = "bob", point = [0, 0, 1], axis = [0, 1, 0] }
stiffness = 0
damping = 4
[forces.shaker]
type = "load"
a = { body = "bob" }
force = [0.01, 0, 0]
factor = "cos(w*t)"
[integrator]
method = "generalized-alpha"
step = 0.1
end = 1
)toml";
  for (const char* quantity : {"bob.position.x", "hinge.force.x"})
    expect_steady_state(text, quantity, 0.5, 14, "pendulum");
}

// A wire of beam elements with damping, between its first and second resonance.
TEST(ModelHarmonicTruth, IsTheSteadyStateOfABeam) {
  std::string text = test::cantilever(3, 0, "[integrator]\nmethod = \"generalized-alpha\"\nstep = 0.1\nend = 1\n");
  text.replace(text.find("radius = 0.005"), 14, "radius = 0.005\ndamping = { stiffness = 0.005, mass = 10 }");
  text.replace(text.find("factor = 0"), 10, "factor = \"cos(2*pi*8*t)\"");
  text.replace(text.find("force = [0, 0, 1]"), 17, "force = [0, 0, 0.1]");
  text.erase(text.find("[harmonic]"));
  for (const char* quantity : {"tip.position.z", "wall.moment.y"}) expect_steady_state(text, quantity, 8, 12, "beam");
}

// The engine at its dead centre: three of these forces are zero by symmetry, but for rounding 13 digits below the
// others. Nothing follows it, and a sharp peak is found where the modes of the model are (560.0, 851.4, 1334.1 Hz).
TEST(ModelHarmonicTruth, ZerosBySymmetryAreNotFollowed) {
  SimulationOptions o;
  o.set = {"parameters.unknowns=1000",
           "harmonic.loads=[\"motor\"]",
           "harmonic.from=10",
           "harmonic.to=2000",
           "harmonic.loss_factor=0.01",
           "harmonic.tolerance=1e-3",
           "harmonic.max_solves=60",
           "harmonic.quantities=[\"crank_pin.force\", \"wrist_pin.force.x\", \"motor.moment.z\"]"};
  o.solver = {{"threads", "1"}};
  const ModelHarmonicResult r = model_harmonic((espalier::test::source_folder() / "models/engine.toml").string(), o);
  ASSERT_TRUE(r.status.ok()) << r.status.message;
  EXPECT_LE(r.response.factorizations, 40);
  EXPECT_TRUE(r.notices.empty()) << r.notices[0];
  double highest = 0, at = 0;
  for (std::size_t p = 0; p < r.response.points.size(); ++p)
    if (const double size = std::abs(value_of(r, p, "motor.moment.z")); size > highest)
      highest = size, at = r.response.points[p].frequency;
  EXPECT_NEAR(at, 1334.1, 0.5);
}

}  // namespace
}  // namespace espalier::dynamics

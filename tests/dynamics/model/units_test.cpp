// A model in other units of length, mass and time gives the same answers. Truth: the model itself, in metres, kilograms
// and seconds; each quantity is converted by its dimension.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace units_test {

struct Units {
  const char* name;
  double m, kg, s;  // a metre, a kilogram, a second in these units
};

const std::vector<Units> kUnits = {{"millimetre, tonne, second", 1e3, 1e-3, 1},
                                   {"micrometre, kilogram, second", 1e6, 1, 1},
                                   {"micrometre, gram, millisecond", 1e6, 1e3, 1e3},
                                   {"inch, slinch, second", 1 / 0.0254, 1 / 175.126835, 1},
                                   {"kilometre, tonne, hour", 1e-3, 1e-3, 1 / 3600.0}};

/// What one of a dimension ("length/time", "force*length") is in other units.
double factor_of(const std::string& dimension, const Units& u) {
  const double force = u.kg * u.m / (u.s * u.s);
  const std::map<std::string, double> known = {{"length", u.m},
                                               {"time", u.s},
                                               {"mass", u.kg},
                                               {"force", force},
                                               {"energy", force * u.m},
                                               {"angle", 1},
                                               {"1", 1},
                                               {"", 1},
                                               {"pressure", force / (u.m * u.m)}};
  double factor = 1;
  std::size_t at = 0;
  char operation = '*';
  while (at <= dimension.size()) {
    const std::size_t end = std::min(dimension.find_first_of("*/", at), dimension.size());
    std::string word = dimension.substr(at, end - at);
    int power = 1;
    if (const std::size_t hat = word.find('^'); hat != std::string::npos) {
      power = std::stoi(word.substr(hat + 1));
      word.resize(hat);
    }
    const auto found = known.find(word);
    if (found == known.end()) ADD_FAILURE() << "dimension " << dimension;
    const double one = found == known.end() ? 1 : std::pow(found->second, power);
    factor = operation == '*' ? factor * one : factor / one;
    operation = end < dimension.size() ? dimension[end] : ' ';
    at = end + 1;
  }
  return factor;
}

std::unique_ptr<Simulation> run_in(const std::string& text, const Units& u) {
  SimulationOptions options;
  options.set = {fmt::format("parameters.m={:.17g}", u.m), fmt::format("parameters.kg={:.17g}", u.kg),
                 fmt::format("parameters.s={:.17g}", u.s)};
  auto run = std::make_unique<Simulation>(options);
  Status status = run->load_text(text, "units.toml");
  if (status.ok()) status = run->run();
  EXPECT_TRUE(status.ok()) << u.name << ": " << status.message;
  return run;
}

/// All modes within `tolerance`, energies and quantities, each of the largest of its kind (vectors as a whole), within
/// that or `of_motion`, as far as Newton's iteration ends at other places.
void expect_same(const std::string& text, double tolerance, double of_motion = 0) {
  of_motion = std::max(of_motion, tolerance);
  const Units si = {"SI", 1, 1, 1};
  const auto truth = run_in(text, si);
  ASSERT_FALSE(::testing::Test::HasFailure());
  const SimulationSummary& a = truth->summary();
  for (const Units& u : kUnits) {
    const auto other = run_in(text, u);
    if (::testing::Test::HasFailure()) return;
    const SimulationSummary& b = other->summary();
    ASSERT_EQ(a.modes.size(), b.modes.size());
    for (std::size_t i = 0; i < a.modes.size(); ++i) {
      EXPECT_NEAR(b.modes[i].frequency * u.s, a.modes[i].frequency, tolerance * a.modes[i].frequency)
          << u.name << ", mode " << i;
      EXPECT_NEAR(b.modes[i].damping_ratio, a.modes[i].damping_ratio, tolerance) << u.name << ", mode " << i;
    }
    ASSERT_EQ(a.critical.size(), b.critical.size());
    for (std::size_t i = 0; i < a.critical.size(); ++i)
      EXPECT_NEAR(b.critical[i].load, a.critical[i].load, 1e3 * tolerance * std::abs(a.critical[i].load)) << u.name;
    EXPECT_EQ(a.steps, b.steps) << u.name;
    EXPECT_EQ(a.notices.size(), b.notices.size()) << u.name;
    EXPECT_EQ(a.redundant, b.redundant) << u.name;
    const double joule = factor_of("energy", u);
    const double scale = std::max({std::abs(a.energy_end.kinetic), std::abs(a.energy_end.potential), 1e-300});
    EXPECT_NEAR(b.energy_end.kinetic / joule, a.energy_end.kinetic, of_motion * scale) << u.name;
    EXPECT_NEAR(b.energy_end.potential / joule, a.energy_end.potential, of_motion * scale) << u.name;
    std::map<std::string, double> size;
    const auto known = truth->quantities();
    for (const SimulationQuantity& q : known)
      if (!q.dimension.empty()) size[q.dimension] = std::max(size[q.dimension], std::abs(truth->value(q.name)));
    int compared = 0;
    for (const SimulationQuantity& q : known) {
      if (q.dimension.empty() || q.name.rfind("step.", 0) == 0 || q.name.rfind("constraints.", 0) == 0) continue;
      ++compared;
      EXPECT_NEAR(other->value(q.name) / factor_of(q.dimension, u), truth->value(q.name), of_motion * size[q.dimension])
          << u.name << ", " << q.name << " (" << q.dimension << ")";
    }
    EXPECT_GT(compared, 10);
  }
}

const std::string kHead = R"([parameters]
m = 1
kg = 1
s = 1
N = "kg*m/s^2"
[materials.steel]
young = "2.1e11*N/m^2"
poisson = 0.3
density = "7850*kg/m^3"
)";

const std::string kBrief = "[integrator]\nmax_order = 2\nend = \"1e-6*s\"\nconstraint_tolerance = \"1e-10*m\"\n";

// Frequencies from the slowest bending to the section's own, 10^8 apart. (Rounding of the stiffness leaves 1e-9.)
TEST(Units, ModesOfThinWires) {
  for (const std::string radius : {"1e-4", "1e-3", "0.02"}) {
    const std::string text =
        kHead + "[bodies.wire]\ntype = \"beam\"\nstart = [0, 0, 0]\nend = [\"0.5*m\", 0, 0]\n" +
        "elements = 12\nmaterial = \"steel\"\nradius = \"" + radius + "*m\"\n" +
        "[joints.clamp]\ntype = \"fixed\"\na = { body = \"ground\" }\nb = { body = \"wire\", node = "
        "1 }\n[initial]\nmodes = 12\n" +
        kBrief;
    expect_same(text, radius == "1e-4" ? 2e-8 : 1e-9);
  }
}

const std::string kRotor = kHead + R"([bodies.beam]
type = "beam"
start = [0, 0, 0]
end = ["0.6*m", 0, 0]
elements = 4
radius = "0.004*m"
material = "steel"
damping = { stiffness = "1e-6*s", mass = "0.3/s" }
[bodies.disc]
type = "rigid"
mass = "2*kg"
inertia = ["0.01*kg*m^2", "0.005*kg*m^2", "0.005*kg*m^2"]
position = ["0.6*m", 0, 0]
angular_velocity = ["200/s", 0, 0]
[joints.clamp]
type = "fixed"
a = { body = "ground" }
b = { body = "beam", node = 1 }
[joints.spin]
type = "revolute"
a = { body = "beam", node = -1, axis = [1, 0, 0] }
b = { body = "disc", axis = [1, 0, 0] }
[forces.damper]
type = "spring"
a = { body = "disc" }
b = { body = "ground", point = ["0.6*m", "0.2*m", "0.1*m"] }
stiffness = "300*N/m"
damping = "4*N*s/m"
[initial]
modes = 12
)";

// Damping of many sizes, gyroscopic terms.
TEST(Units, ModesAndMotionOfARotor) {
  expect_same("gravity = [0, 0, \"-9.81*m/s^2\"]\n" + kRotor +
                  "[integrator]\nmethod = \"generalized-alpha\"\nstep = \"5e-4*s\"\nend = \"0.01*s\"\n"
                  "constraint_tolerance = \"1e-11*m\"\ntolerance = 1e-12\nnewton_tolerance = 1e-6\nabsolute = 1e-3\n",
              1e-9, 1e-6);
}

TEST(Units, SolidsInEquilibriumAndTheirModes) {
  const std::string text = kHead + R"([bodies.bar]
type = "solid"
mesh = { part = "block", lx = "0.4*m", ly = "0.03*m", lz = "0.02*m", divisions = [6, 1, 1] }
material = "steel"
[joints.clamp]
type = "fixed"
a = { body = "ground", point = [0, "0.015*m", "0.01*m"] }
b = { body = "bar", face = "x0" }
[forces.push]
type = "load"
a = { body = "bar", face = "x1" }
force = ["10*N", "20*N", "-300*N"]
moment = ["1*N*m", 0, 0]
[initial]
modes = 8
[statics]
)";
  expect_same(text, 1e-9);
}

// No tolerances: the same steps. A crank drives a beam that rings; a ball falls on the floor beside it.
TEST(Units, MotionWithoutTolerances) {
  expect_same("gravity = [0, 0, \"-9.81*m/s^2\"]\n" + kHead + R"([bodies.crank]
type = "rigid"
mass = "1*kg"
inertia = ["0.001*kg*m^2", "0.001*kg*m^2", "0.001*kg*m^2"]
position = ["0.05*m", 0, 0]
angular_velocity = [0, "20/s", 0]
[bodies.beam]
type = "beam"
start = ["0.1*m", 0, 0]
end = ["1.1*m", 0, 0]
elements = 2
height = "0.02*m"
width = "0.004*m"
material = "steel"
[joints]
bearing = { type = "revolute", bodies = ["ground", "crank"], at = [0, 0, 0], axis = [0, 1, 0] }
pin = { type = "revolute", a = { body = "crank", point = ["0.05*m", 0, 0], axis = [0, 1, 0] }, b = { body = "beam", node = 1, axis = [0, 1, 0] } }
[integrator]
end = "0.004*s"
)",
              1e-8, 1e-5);
  expect_same("gravity = [0, 0, \"-9.81*m/s^2\"]\n" + kHead + R"([bodies.ball]
type = "rigid"
mass = "2*kg"
inertia = ["0.008*kg*m^2", "0.008*kg*m^2", "0.008*kg*m^2"]
position = [0, 0, "0.11*m"]
velocity = ["1*m/s", 0, 0]
[surfaces]
ball = { body = "ball", shape = "sphere", radius = "0.1*m" }
floor = { body = "ground", shape = "plane" }
[contacts.landing]
surfaces = ["ball", "floor"]
stiffness = "1e6*N/m"
[integrator]
end = "0.05*s"
)",
              1e-8, 1e-5);
}

// A mechanism whose loop has redundant constraints, with velocities that follow from one that is given.
TEST(Units, MechanismWithRedundantJoints) {
  const std::string text = "gravity = [0, 0, \"-9.81*m/s^2\"]\n" + kHead + R"([bodies.crank]
type = "rigid"
mass = "1*kg"
inertia = ["0.001*kg*m^2", "0.001*kg*m^2", "0.001*kg*m^2"]
position = ["0.05*m", 0, 0]
angular_velocity = [0, 0, "20/s"]
[bodies.rod]
type = "rigid"
mass = "2*kg"
inertia = ["0.01*kg*m^2", "0.02*kg*m^2", "0.02*kg*m^2"]
position = ["0.3*m", 0, 0]
[bodies.slider]
type = "rigid"
mass = "3*kg"
inertia = ["0.01*kg*m^2", "0.01*kg*m^2", "0.01*kg*m^2"]
position = ["0.5*m", 0, 0]
[joints]
bearing = { type = "revolute", bodies = ["ground", "crank"], at = [0, 0, 0], axis = [0, 0, 1] }
pin = { type = "revolute", bodies = ["crank", "rod"], at = ["0.1*m", 0, 0], axis = [0, 0, 1] }
wrist = { type = "revolute", bodies = ["rod", "slider"], at = ["0.5*m", 0, 0], axis = [0, 0, 1] }
guide = { type = "prismatic", bodies = ["ground", "slider"], at = ["0.5*m", 0, 0], axis = [1, 0, 0] }
[forces.spring]
type = "spring"
a = { body = "slider" }
b = { body = "ground", point = ["0.9*m", 0, 0] }
stiffness = "1e3*N/m"
damping = "10*N*s/m"
[integrator]
method = "generalized-alpha"
step = "1e-3*s"
end = "0.05*s"
constraint_tolerance = "1e-12*m"
tolerance = 1e-12
newton_tolerance = 1e-6
)";
  expect_same(text, 1e-8);
}

}  // namespace units_test
}  // namespace espalier::dynamics

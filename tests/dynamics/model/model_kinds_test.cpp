// Every kind of body, joint and force through the text. Truth: closed forms of statics; degrees of freedom by counting.
#include <gtest/gtest.h>

#include "base/strtod.hpp"
#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace {

const std::string kStatics = R"([integrator]
method = "generalized-alpha"
step = 1e-3
end = 1e-3
[initial]
statics = true
)";
// Stiff bodies: round-off of their forces is above the default of 1e-9 of the load.
const std::string kStiffStatics = kStatics;

TEST(ModelKinds, BeamCantileverBendsAsItsClosedFormSays) {
  // Timoshenko: P L^3 / (3 E I) + P L / (k G A), small load.
  const Simulation s = simulated(R"([bodies.beam]
type = "beam"
start = [0, 0, 0]
end = [2, 0, 0]
elements = 16
height = 0.1
width = 0.2
material = { young = 2e9, poisson = 0.3, density = 1000 }
[markers.tip]
body = "beam"
node = -1
[joints.wall]
type = "fixed"
a = { body = "ground", axis = [1, 0, 0] }
b = { body = "beam", node = 1, axis = [1, 0, 0] }
[forces.weight]
type = "load"
a = "tip"
force = [0, -10, 0]
)" + kStiffStatics);
  const double e = 2e9, i = 0.2 * 1e-3 / 12, g = e / 2.6, k = 10 * 1.3 / (12 + 11 * 0.3);
  const double expected = 10 * 8 / (3 * e * i) + 10 * 2 / (k * g * 0.02);
  EXPECT_NEAR(s.value("tip.position.y"), -expected, 1e-3 * expected);  // 16 elements
  EXPECT_NEAR(s.value("wall.force.y"), 10, 1e-5);
  EXPECT_NEAR(s.value("wall.moment.z"), 20, 1e-4);
}

TEST(ModelKinds, CableHangsAtItsWeight) {
  const Simulation s = simulated(R"(gravity = [0, 0, -10]
[bodies.cable]
type = "cable"
start = [0, 0, 0]
end = [0, 0, -2]
elements = 4
axial = 1e4
bending = 1
mass_per_length = 3
[joints.hook]
type = "spherical"
a = { body = "ground" }
b = { body = "cable", node = 1 }
[markers.end]
body = "cable"
node = -1
)" + kStatics);
  EXPECT_NEAR(s.value("hook.force.z"), 60, 1e-5);  // of the joint on the cable
  EXPECT_NEAR(s.value("end.position.z"), -2 - 3 * 10 * 4 / (2 * 1e4), 1e-6);
  EXPECT_NEAR(s.value("cable.mass"), 6, 1e-12);
}

TEST(ModelKinds, PressureShortensABlockUniformly) {
  const Simulation s = simulated(R"([materials.soft]
law = "neo-hookean"
young = 1e6
density = 1000
[bodies.block]
type = "solid"
mesh = { part = "block", lx = 2, divisions = [2, 2, 2] }
material = "soft"
[joints.wall]
type = "fixed"
a = { body = "ground", point = [0, 0.5, 0.5] }
b = { body = "block", face = "x0" }
[markers.end]
body = "block"
face = "x1"
[forces.press]
type = "pressure"
body = "block"
face = "x1"
pressure = "100 + 0*t"
)" + kStatics);
  EXPECT_NEAR(s.value("end.position.x"), 2 - 2 * 100 / 1e6, 2e-7);  // Poisson's ratio 0: uniaxial; O(strain^2)
  EXPECT_NEAR(s.value("wall.force.x"), 100, 0.1);
}

TEST(ModelKinds, ShellPlateHasItsMassAndBendsLikeABeam) {
  const Simulation s = simulated(R"([bodies.plate]
type = "shell"
x = [1, 0, 0]
y = [0, 0.1, 0]
nx = 20
ny = 1
thickness = 0.02
material = { young = 1e9, poisson = 0, density = 500 }
[markers.middle]
body = "plate"
node = 11
[[repeat]]
index = "side"
to = 1
[repeat.joints."hold{side}"]
type = "spherical"
a = { body = "ground", point = [0, "0.1*side", 0] }
b = { body = "plate", node = "1 + 21*side" }
[repeat.joints."rest{side}"]
type = "prescribed"
direction = "z"
a = { body = "ground" }
b = { body = "plate", node = "21 + 21*side" }
motion = 0
[repeat.forces."half{side}"]
type = "load"
a = { body = "plate", node = "11 + 21*side" }
force = [0, 0, -0.5]
)" + kStiffStatics);
  EXPECT_NEAR(s.value("plate.mass"), 500 * 0.1 * 0.02, 1e-12);
  const double bending = 1.0 / (48 * 1e9 * 0.1 * 8e-6 / 12);  // P L^3 / (48 E I), supported at both ends
  EXPECT_NEAR(s.value("middle.position.z"), -bending, 0.01 * bending);
}

TEST(ModelKinds, EveryJointLeavesItsDegreesOfFreedom) {
  const std::string bodies = R"([bodies.one]
type = "rigid"
mass = 1
box = [0.1, 0.2, 0.3]
[bodies.two]
type = "rigid"
mass = 2
box = [0.3, 0.2, 0.1]
position = [1, 0, 0]
[integrator]
end = 0.01
[joints.j]
)";
  const std::string pair = "bodies = [\"one\", \"two\"]\nat = [0.5, 0, 0]\naxis = [0, 0, 1]\n";
  const std::string apart = "a = { body = \"one\", axis = [0, 0, 1] }\nb = { body = \"two\" }\n";
  const std::string four =
      "a = { body = \"ground\", axis = [0, 0, 1] }\nb = { body = \"one\" }\nc = { body = \"ground\", axis = [0, 0, 1] "
      "}\nd = { body = \"two\" }\n";
  struct Case {
    std::string type, keys;
    int freedom;
  };
  const std::vector<Case> cases = {
      {"fixed", pair, 6},
      {"revolute", pair, 7},
      {"spherical", pair, 9},
      {"universal", pair, 8},
      {"cylindrical", pair, 8},
      {"prismatic", pair, 7},
      {"planar", pair, 9},
      {"point-on-line", pair, 10},
      {"distance", apart, 11},
      {"revolute-spherical", apart, 10},
      {"rotation-motor", apart + "motion = \"t\"\n", 11},
      {"translation-motor", apart + "motion = \"0.1*t^2\"\n", 11},
      {"prescribed", apart + "direction = \"x\"\nmotion = \"t\"\nfrom = \"initial\"\n", 11},
      {"gear", four + "ratio = 2\n", 11},
      {"rack-and-pinion", four + "radius = 0.2\n", 11},
      {"screw", pair + "lead = 0.1\n", 7},
      {"constant-velocity", pair, 8},
      {"parallel-axes", pair, 10},
      {"in-plane", pair, 11},
      {"in-line", pair, 10},
      {"point-on-curve", pair + "points = [[0, 0, -1], [0, 0, 1]]\nends = \"straight\"\n", 10},
      {"point-on-curve",
       pair + "points = [[0, 0, -1], [0, 0, 1]]\nends = \"straight\"\nmotion = \"t\"\nfrom = \"initial\"\n", 9},
      {"point-on-surface", "a = { body = \"one\" }\nb = { body = \"two\" }\nshape = \"sphere\"\nradius = 1\n", 11},
      {"gear-pair", apart + "teeth = [10, 20]\n", 11},
      {"rack-pair", "a = { body = \"one\", axis = [0, 1, 0] }\nb = { body = \"two\", axis = [0, 0, 1] }\n", 11},
      {"worm",
       "a = { body = \"one\", axis = [0, 1, 0] }\nb = { body = \"two\", axis = [0, 0, 1] }\nlead = 0.1\nradius = 0.8\n",
       11},
      {"cable", "through = [\"one\", { body = \"ground\", point = [0, 1, 0] }, \"two\"]\n", 11}};
  for (const Case& c : cases) {
    const Simulation s = simulated(bodies + "type = \"" + c.type + "\"\n" + c.keys);
    EXPECT_EQ(s.summary().degrees_of_freedom, c.freedom) << c.type;
    EXPECT_TRUE(s.summary().redundant.empty()) << c.type;
    EXPECT_LT(s.summary().largest_violation.position, 1e-9) << c.type;
  }
}

TEST(ModelKinds, SpringsDampersAndBushingsSettleWhereStaticsSays) {
  const auto rest = [](const std::string& force) {
    return simulated(R"(gravity = [0, 0, -10]
[bodies.m]
type = "rigid"
mass = 0.5
box = [0.1, 0.1, 0.1]
position = [0, 0, -1]
[joints.rail]
type = "prismatic"
bodies = ["ground", "m"]
at = [0, 0, -1]
axis = [0, 0, 1]
[forces.f]
a = { body = "ground", axis = [0, 0, 1] }
b = { body = "m" }
)" + force + kStatics);
  };
  EXPECT_NEAR(rest("type = \"spring\"\nstiffness = 100\nrest = 0.9\n").value("m.position.z"), -0.95, 1e-8);
  EXPECT_NEAR(rest("type = \"spring\"\nstiffness = 100\npreload = 2\n").value("m.position.z"), -1.03, 1e-8);
  EXPECT_NEAR(rest("type = \"axial-spring\"\nstiffness = 100\n").value("m.position.z"), -1.05, 1e-8);
  EXPECT_NEAR(rest("type = \"spring\"\nstiffness = 100\nactuator = \"5 + t\"\n").value("m.position.z"), -1, 1e-8);
  EXPECT_NEAR(rest("type = \"bushing\"\nstiffness = [0, 0, 100]\n").value("m.position.z"), -0.05, 1e-8);
  EXPECT_NEAR(rest("type = \"bushing\"\nstiffness = [0, 0, 100]\n").value("f.force.z"), 5, 1e-6);
}

TEST(ModelKinds, OutputsComeAtTheirTimes) {
  const ScratchFolder folder;
  SimulationOptions options;
  options.out = folder.path();
  static_cast<void>(simulated(
      kPendulum + "[output]\nexact_times = true\ncsv_interval = 0.25\nreactions = true\nstep_data = true\n", options));
  std::istringstream lines(content_of(folder.path() + "/quantities.csv"));
  std::string header, line;
  std::getline(lines, header);
  for (const std::string word :
       {"hinge.force.x", "hinge.moment.z", "energy.total", "constraints.velocity", "step.order"})
    EXPECT_NE(header.find(word), std::string::npos) << word;
  std::vector<double> times;
  while (std::getline(lines, line)) times.push_back(base::strtod(line.c_str()));
  ASSERT_EQ(times.size(), 5U);
  for (std::size_t k = 0; k < 5; ++k) EXPECT_NEAR(times[k], 0.25 * static_cast<double>(k), 1e-15);
}

}  // namespace
}  // namespace espalier::dynamics

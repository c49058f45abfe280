// How runs end and go on, evenly spaced frames, overrides of repetitions, point masses, Gmsh's .inp files, unsymmetric
// matrices with ldlt. Truth: closed forms, counts, and the same model written otherwise.
#include <gtest/gtest.h>

#include <cmath>

#include "base/strtod.hpp"
#include "dynamics/guarded.hpp"
#include "dynamics/integrators/interpolation.hpp"
#include "dynamics/mesh/read.hpp"
#include "dynamics/model/built_model.hpp"
#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace {

bool says(const std::vector<std::string>& notices, const std::string& words) {
  for (const std::string& notice : notices)
    if (notice.find(words) != std::string::npos) return true;
  return false;
}

// What each public entry says where memory does not do: responses, modes, derivatives, checks and FMUs as runs do.
TEST(ModelEnds, WithoutMemoryAreAStatus) {
  const auto of = [](auto failure) { return guarded([&] { throw failure; }); };
  EXPECT_EQ(of(std::bad_alloc()).code, StatusCode::out_of_memory);
  EXPECT_EQ(of(std::length_error("vector")).code, StatusCode::out_of_memory);
  EXPECT_EQ(of(Error(StatusCode::singular, "no", 3)).row, 3);
  EXPECT_TRUE(guarded([] {}).ok());
}

TEST(ModelEnds, AfterANumberOfSteps) {
  for (const char* method : {"steps = 37\n", "steps = 37\nmethod = \"generalized-alpha\"\nstep = 0.01\n"}) {
    std::string text = replaced(kPendulum, "end = 1", method);
    if (std::string(method).find("alpha") != std::string::npos)
      text = replaced(text, "relative = 1e-10\nabsolute = 1e-10\n", "");
    const Simulation s = simulated(text);
    EXPECT_EQ(s.summary().steps, 37);
    EXPECT_FALSE(s.summary().interrupted);
    if (s.summary().method != "bdf") {
      EXPECT_NEAR(s.time(), 0.37, 1e-12);
    }
  }
  // What comes first ends the run.
  EXPECT_EQ(simulated(kPendulum + "steps = 1000000\n").time(), 1);
}

TEST(ModelEnds, ARestartOfACompleteRunHasNothingToDo) {
  const ScratchFolder folder;
  SimulationOptions options;
  options.out = folder.path();
  const Simulation first = simulated(kPendulum, options);
  const std::string rows = content_of(folder.path() + "/quantities.csv");
  options.restart = folder.path() + "/state.restart";
  const Simulation again = simulated(kPendulum, options);
  EXPECT_EQ(again.summary().steps, first.summary().steps);
  EXPECT_TRUE(says(again.summary().notices, "complete"));
  EXPECT_EQ(again.value("bob.position.x"), first.value("bob.position.x"));
  EXPECT_EQ(content_of(folder.path() + "/quantities.csv"), rows);
}

/// The times in a .pvd file.
std::vector<double> frames(const std::string& path) {
  const std::string text = content_of(path);
  std::vector<double> times;
  const std::string key = "timestep=\"";
  for (std::size_t at = text.find(key); at != std::string::npos; at = text.find(key, at + 1))
    times.push_back(base::strtod(text.c_str() + at + key.size()));
  return times;
}

TEST(ModelEnds, FramesAreEvenlySpacedWhateverTheSteps) {
  const ScratchFolder folder;
  SimulationOptions options;
  options.out = folder.path();
  options.set = {"output.vtu_interval=0.0625", "output.format=vtu"};
  static_cast<void>(simulated(kPendulum, options));
  const std::vector<double> times = frames(folder.path() + "/motion.pvd");
  ASSERT_EQ(times.size(), 17U);
  for (std::size_t k = 0; k < times.size(); ++k) EXPECT_NEAR(times[k], 0.0625 * static_cast<double>(k), 1e-12);
}

// A body that turns about a fixed axis at a constant rate moves on a geodesic of its chart: interpolation is exact. On
// a pendulum's arc the error of q falls with h^4.
TEST(ModelEnds, InterpolationBetweenStepsIsOfFourthOrder) {
  const auto mechanism = built(kPendulum);
  const auto at = [&](double t) {  // x = (sin, -cos) of t + t^2, turned accordingly
    State s(mechanism->system.sizes());
    const double a = t + t * t, w = 1 + 2 * t;
    s.t = t;
    s.q = {std::sin(a), -std::cos(a), 0, std::cos(a / 2), 0, 0, std::sin(a / 2)};
    s.v = {w * std::cos(a), w * std::sin(a), 0, 0, 0, w};
    return s;
  };
  double before = 0;
  for (const double h : {0.4, 0.2, 0.1}) {
    const State middle = between(mechanism->system, at(0.3), at(0.3 + h), 0.3 + 0.4 * h), truth = at(0.3 + 0.4 * h);
    double error = 0;
    for (std::size_t i = 0; i < truth.q.size(); ++i) error = std::max(error, std::abs(middle.q[i] - truth.q[i]));
    if (before > 0) {
      EXPECT_NEAR(std::log2(before / error), 4, 0.4);
    }
    before = error;
  }
  EXPECT_LT(before, 1e-5);
}

const std::string kRow = R"toml([[repeat]]
to = 2
[repeat.bodies."bead{i}"]
type = "point"
mass = "1 + i"
position = ["i", 0, 0]
velocity = [0, "i", 0]
[repeat.forces."pull{i}"]
type = "load"
a = { body = "bead{i}" }
force = [6, 0, 0]
[integrator]
relative = 1e-10
absolute = 1e-10
end = 1
)toml";

TEST(ModelEnds, PointMassesMoveAsNewtonSays) {
  const Simulation s = simulated("gravity = [0, 0, -10]\n" + kRow);
  EXPECT_EQ(s.summary().velocities, 9);
  EXPECT_NEAR(s.value("bead2.position.x"), 2 + 0.5 * 6 / 3, 1e-9);
  EXPECT_NEAR(s.value("bead2.position.y"), 2, 1e-12);
  EXPECT_NEAR(s.value("bead0.velocity.z"), -10, 1e-9);
  EXPECT_NEAR(s.value("bead1.acceleration.x"), 3, 1e-9);
  // Potential and kinetic energy: 6 t^2 ... of all three, closed form at t = 1.
  EXPECT_NEAR(s.summary().energy_end.kinetic, 0.5 * (1 * (36 + 100) + 2 * (9 + 1 + 100) + 3 * (4 + 4 + 100)), 1e-7);
  EXPECT_NEAR(s.summary().energy_end.potential, -(1 + 2 + 3) * 10 * 5, 1e-7);
}

TEST(ModelEnds, PointMassOnAStringIsAPendulum) {
  const std::string text = R"toml(gravity = [0, -10, 0]
[bodies.bob]
type = "point"
mass = 2
position = [1, 0, 0]
[joints.string]
type = "distance"
a = { body = "ground" }
b = { body = "bob" }
[joints.plane]
type = "prescribed"
direction = "z"
motion = "0"
a = { body = "ground" }
b = { body = "bob" }
[integrator]
relative = 1e-10
absolute = 1e-10
end = 1
)toml";
  const ScratchFolder folder;
  SimulationOptions options;
  options.out = folder.path();
  options.set = {"output.vtu_interval=0.5", "output.format=vtu"};
  const Simulation point = simulated(text, options), rigid = simulated(kPendulum);
  EXPECT_NEAR(point.value("bob.position.x"), rigid.value("bob.position.x"), 1e-7);
  EXPECT_NEAR(point.value("bob.position.y"), rigid.value("bob.position.y"), 1e-7);
  EXPECT_EQ(frames(folder.path() + "/motion.pvd").size(), 3U);
}

TEST(ModelEnds, OverridesReachIntoRepetitions) {
  SimulationOptions options;
  options.set = {"repeat.0.to=4", "bodies.bead3.mass=\"12 + i\"", "forces.pull3.force=[30, 0, 0]"};
  const Simulation s = simulated(kRow, options);
  EXPECT_EQ(s.summary().bodies, 5);
  EXPECT_NEAR(s.value("bead3.acceleration.x"), 30.0 / 15, 1e-9);
  EXPECT_NEAR(s.value("bead4.acceleration.x"), 6.0 / 5, 1e-9);
  for (const char* wrong : {"repeat.1.to=4", "repeat.x.to=4", "repeat.0.until=4"}) {
    options.set = {wrong};
    Simulation broken(options);
    const Status status = broken.load_text(kRow, "model.toml");
    EXPECT_EQ(status.code, StatusCode::invalid_input) << wrong;
  }
}

/// A cube of six tetrahedra with the surface, line and point elements that Gmsh writes along, marked by sets.
std::string gmsh_cube(const std::string& more = "") {
  return R"toml(*Heading
 cube.inp
*NODE
1, 0, 0, 0
2, 1, 0, 0
3, 1, 1, 0
4, 0, 1, 0
5, 0, 0, 1
6, 1, 0, 1
7, 1, 1, 1
8, 0, 1, 1
******* E L E M E N T S *************
*ELEMENT, type=T3D2, ELSET=Line1
1, 1, 2
*ELEMENT, type=CPS3, ELSET=Surface1
2, 1, 2, 3
3, 1, 3, 4
*ELEMENT, type=C3D4, ELSET=Volume1
4, 1, 2, 3, 7
5, 1, 3, 4, 7
6, 1, 4, 8, 7
7, 1, 8, 5, 7
8, 1, 5, 6, 7
9, 1, 6, 2, 7
*ELSET,ELSET=bottom
2, 3,
)toml" + more;
}

TEST(ModelEnds, GmshInpNeedsNoElementSet) {
  const ScratchFolder folder;
  const std::string path = folder.path() + "/cube.inp";
  std::ofstream(path) << gmsh_cube();
  const Mesh mesh = read_mesh(path);
  ASSERT_TRUE(mesh.face_sets.contains("bottom"));
  EXPECT_EQ(mesh.face_set("bottom").size(), 2U);
  const std::string text = R"toml([bodies.cube]
type = "solid"
mesh = { file = "cube.inp" }
material = { young = 1e6, density = 6 }
[joints.foot]
type = "fixed"
a = { body = "ground", point = [0.5, 0.5, 0] }
b = { body = "cube", face = "bottom" }
[integrator]
end = 1e-3
)toml";
  std::ofstream(folder.path() + "/model.toml") << text;
  Simulation s;
  Status status = s.load(folder.path() + "/model.toml");
  ASSERT_TRUE(status.ok()) << status.message;
  EXPECT_NEAR(s.value("cube.mass"), 6, 1e-12);
  EXPECT_TRUE(says(s.summary().notices, "serve as sets only"));
  // A beam that stands off the solids is passed over, with its node, which would be a mass without stiffness.
  std::ofstream(path) << gmsh_cube("*NODE\n9, 2, 2, 2\n*ELEMENT, type=T3D2, ELSET=Stray\n10, 7, 9\n");
  status = s.load(folder.path() + "/model.toml");
  ASSERT_TRUE(status.ok()) << status.message;
  EXPECT_NEAR(s.value("cube.mass"), 6, 1e-12);
  EXPECT_EQ(s.summary().velocities, 3 * 8);
  EXPECT_TRUE(says(s.summary().notices, "elements that are no solids are passed over: 1 line2"));
}

TEST(ModelEnds, LdltOnAnUnsymmetricTangentSaysSo) {
  // A point in a field that has a potential, and in one that turns it around.
  const auto notices = [](const std::string& coordinate) {
    SimulationOptions options;
    options.solver = {{"kind", "ldlt"}};
    return simulated(
               "[bodies.dot]\ntype = \"point\"\nmass = 2\nposition = [1, 0.5, 0]\n[forces.field]\ntype = \"load\"\n"
               "a = { body = \"dot\" }\nforce = [\"-300*dot.position." +
                   coordinate + "\", 0, 0]\n[integrator]\nmethod = \"generalized-alpha\"\nstep = 0.01\nend = 0.3\n",
               options)
        .summary()
        .notices;
  };
  EXPECT_TRUE(says(notices("y"), "kind = ldlt"));
  EXPECT_FALSE(says(notices("x"), "kind = ldlt"));
}

}  // namespace
}  // namespace espalier::dynamics

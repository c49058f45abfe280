// Cables, beams and shells in contact. Truth: the capstan equation, weights, the same faces on a solid, symmetry of
// space, the bits of a run that was not interrupted.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "dynamics/contact/solid_contact.hpp"
#include "dynamics/model/built_model.hpp"
#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace contact_lines_test {

constexpr double kPi = std::numbers::pi;

// A rope on half of a drum that turns and slips below it: T2 = T1 exp(mu pi) (Euler and Eytelwein). Its natural shape
// is the arc, so that it bends nowhere; at the anchor it is free to lie down on the drum.
double anchor_over_load(int elements, double stiffness) {
  constexpr double kFriction = 0.3, kOverlap = 1e-7, kRadius = 0.05;
  const std::string text = fmt::format(
      R"(
[bodies.rope]
type = "beam"
start = [{0:.17g}, 0, 0]
direction = [0, 1, 0]
y = [-1, 0, 0]
length = {1:.17g}
curvature = [0, 0, {2:.17g}]
elements = {3}
axial = 1e3
shear_y = 1e3
shear_z = 1e3
torsion = 1e-3
bending_y = 1e-3
bending_z = 1e-3
section_normal = 1e3
section_shear = 1e3
mass_per_length = 1
inertia_y = 1e-3
inertia_z = 1e-3
damping = {{ mass = 20 }}
[bodies.drum]
type = "rigid"
mass = 1
inertia = [1, 1, 1]
[joints.motor]
type = "rotation-motor"
a = {{ body = "ground", axis = [0, 0, 1] }}
b = {{ body = "drum" }}
motion = "0.2*t"
[joints.axle]
type = "revolute"
a = {{ body = "ground", axis = [0, 0, 1] }}
b = {{ body = "drum" }}
[joints.anchor]
type = "prismatic"
a = {{ body = "ground", point = [{0:.17g}, 0, 0], axis = [1, 0, 0], x_axis = [0, 1, 0] }}
b = {{ body = "rope", node = 1, axis = [0, -1, 0] }}
[forces.pull]
type = "load"
a = {{ body = "rope", node = -1 }}
force = [0, -1, 0]
[surfaces.rope]
body = "rope"
shape = "line"
radius = {4}
[surfaces.drum]
body = "drum"
shape = "cylinder"
radius = {5:.17g}
length = 4
[contacts.wrap]
surfaces = ["rope", "drum"]
stiffness = {6}
friction = {7}
[integrator]
method = "generalized-alpha"
spectral_radius = 0.3
step = 2e-3
end = 1.5
)",
      1 - kOverlap, kPi * (1 - kOverlap), 1 / (1 - kOverlap), elements, kRadius, 1 - kRadius, stiffness, kFriction);
  return std::abs(simulated(text).value("anchor.force.y"));
}

TEST(ContactLines, CapstanEquation) {
  const double exact = std::exp(0.3 * kPi);
  EXPECT_NEAR(anchor_over_load(16, 1e3), exact, 2e-3 * exact);
  EXPECT_NEAR(anchor_over_load(16, 1e4), exact, 3e-4 * exact);
  EXPECT_NEAR(anchor_over_load(32, 1e5), exact, 3e-5 * exact);
}

// The table of docs/guide/contact.md: test_dynamics --gtest_also_run_disabled_tests
// --gtest_filter='ContactLines.*Table'
TEST(ContactLines, DISABLED_Table) {
  const double exact = std::exp(0.3 * kPi);
  fmt::print("| elements on half a turn | k = 1e3 | 1e4 | 1e5 |\n|---|---|---|---|\n");
  for (const int elements : {8, 16, 32}) {
    fmt::print("| {} |", elements);
    for (const double k : {1e3, 1e4, 1e5}) fmt::print(" {:.1e} |", anchor_over_load(elements, k) / exact - 1);
    fmt::print("\n");
  }
}

const std::string kFloor = "[surfaces.floor]\nbody = \"ground\"\nshape = \"plane\"\n";
const std::string kRope =
    "[bodies.rope]\ntype = \"cable\"\nstart = [0, 0, {}]\nend = [1, 0, {}]\nelements = 6\naxial = 1e4\nbending = "
    "0.01\nmass_per_length = 0.5\n{}[surfaces.rope]\nbody = \"rope\"\nshape = \"line\"\nradius = 0.02\n";

std::string rope(double z0, double z1, const std::string& more = "") {
  return fmt::format(fmt::runtime(kRope), z0, z1, more);
}

const std::string kSettle = "[integrator]\nmethod = \"generalized-alpha\"\nspectral_radius = 0.5\nstep = 5e-3\nend = ";

TEST(ContactLines, CableFallsAndLies) {
  const std::string text = "gravity = [0, 0, -9.81]\n" + rope(0.05, 0.1, "damping = { mass = 8 }\n") + kFloor +
                           "[contacts.c]\nsurfaces = [\"rope\", \"floor\"]\nstiffness = 5e3\ndamping = 1\n" + kSettle +
                           "4\n";
  const Simulation lies = simulated(text);
  const double length = std::hypot(1, 0.05), weight = 0.5 * 9.81;  // weight over length
  EXPECT_NEAR(lies.value("c.force.z"), -weight * length, 1e-5 * weight);
  EXPECT_NEAR(lies.value("c.penetration"), weight / 5e3, 1e-4 * weight / 5e3);
  EXPECT_NEAR(lies.value("c.area"), length, 1e-12);
}

TEST(ContactLines, EnergyDoesNotGrow) {
  const std::string text = "gravity = [0, 0, -9.81]\n" + rope(0.022, 0.03) + kFloor +
                           "[contacts.c]\nsurfaces = [\"rope\", \"floor\"]\nstiffness = 5e3\n[integrator]\nend = "
                           "0.06\nrelative = 1e-8\nabsolute = 1e-9\n";
  Simulation simulation;
  ASSERT_TRUE(simulation.load_text(text, "rope.toml").ok());
  ASSERT_TRUE(simulation.step_to(1e-4).ok());
  const double before = simulation.value("energy.total");
  double touching = 0;
  for (const double t : {0.02, 0.03, 0.04, 0.05, 0.06}) {
    ASSERT_TRUE(simulation.step_to(t).ok());
    touching += simulation.value("c.points");
    EXPECT_NEAR(simulation.value("energy.total"), before, 1e-6 * 0.5 * 9.81 * 0.05);
  }
  EXPECT_GT(touching, 0);
}

TEST(ContactLines, RestartsKeepTheBits) {
  const std::string text = "gravity = [0, 0, -9.81]\n" + rope(0.021, 0.05, "velocity = [1, 0, 0]\n") + kFloor +
                           "[contacts.c]\nsurfaces = [\"rope\", \"floor\"]\nstiffness = 5e3\nfriction = 0.3\n"
                           "[integrator]\nend = 0.1\n";
  Simulation whole, rest;
  ASSERT_TRUE(whole.load_text(text, "rope.toml").ok());
  ASSERT_TRUE(rest.load_text(text, "rope.toml").ok());
  ASSERT_TRUE(whole.step_to(0.05).ok());
  EXPECT_GT(whole.value("c.friction_force"), 0);
  ASSERT_TRUE(rest.restore(whole.save()).ok());
  ASSERT_TRUE(whole.step_to(0.1).ok());
  ASSERT_TRUE(rest.step_to(0.1).ok());
  EXPECT_EQ(whole.value("c.friction_force"), rest.value("c.friction_force"));
  EXPECT_EQ(whole.save(), rest.save());
}

// ---- Shells

std::string shell(const std::string& more, const std::string& set) {
  return fmt::format(
      "[bodies.plate]\ntype = \"shell\"\norigin = [0, 0, 0]\nx = [1, 0, 0]\ny = [0, 0.8, 0]\nnx = 4\nny = "
      "3\nthickness = 0.02\nmaterial = {{ young = 1e6, poisson = 0.3, density = 800 }}\n{}[surfaces.plate]\nbody = "
      "\"plate\"\nshape = \"faces\"\n{}",
      more, set);
}

TEST(ContactShells, PlateRestsOnThePlane) {
  const std::string text =
      "gravity = [0, 0, -9.81]\n" + shell("position = [0, 0, 0.011]\ndamping = { mass = 20 }\n", "") + kFloor +
      "[contacts.c]\nsurfaces = [\"plate\", \"floor\"]\nstiffness = 1e6\ndamping = 10\n" + kSettle + "2\n";
  const Simulation rests = simulated(text);
  const double weight = 800 * 0.02 * 9.81;  // on an area
  EXPECT_NEAR(rests.value("c.force.z"), -0.8 * weight, 1e-5 * weight);
  EXPECT_NEAR(rests.value("c.area"), 0.8, 1e-12);
  EXPECT_NEAR(rests.value("c.pressure"), weight, 1e-5 * weight);
  EXPECT_NEAR(rests.value("c.penetration"), weight / 1e6, 1e-5 * weight / 1e6);
}

// Sides of a shell are where the faces of a solid of one layer are.
TEST(ContactShells, SidesAreFacesOfASolid) {
  const std::string ball =
      "[surfaces.ball]\nbody = \"ground\"\nshape = \"sphere\"\nradius = 0.5\npoint = [0.4, 0.5, {}]\n"
      "[contacts.c]\nsurfaces = [\"plate\", \"ball\"]\nstiffness = 1e5\noverlap = 1\n[integrator]\nend = 1\n";
  const std::string solid =
      "[bodies.plate]\ntype = \"solid\"\nmesh = { part = \"block\", lx = 1, ly = 0.8, lz = 0.02, divisions = [4, 3, 1] "
      "}\nmaterial = { young = 1e6, poisson = 0.3, density = 800 }\nposition = [0, 0, -0.01]\n[surfaces.plate]\nbody = "
      "\"plate\"\nshape = \"faces\"\nset = \"";
  for (const double side : {1.0, -1.0}) {
    const std::string at = fmt::format(fmt::runtime(ball), side * 0.47);
    const auto of_shell = built(shell("", side > 0 ? "set = \"top\"\n" : "set = \"bottom\"\n") + at);
    const auto of_both = built(shell("", "") + at);
    const auto of_solid = built(solid + (side > 0 ? "z1\"\n" : "z0\"\n") + at);
    const auto report = [](model::Mechanism& m) {
      State s(m.system.sizes());
      m.system.initial(s.q, s.v);
      return m.surface_contacts.front().parts.front()->report(s.view());
    };
    const contact::ContactReport a = report(*of_shell), b = report(*of_solid), both = report(*of_both);
    ASSERT_GT(b.points, 3);
    EXPECT_EQ(a.points, b.points);
    EXPECT_NEAR(a.normal_force, b.normal_force, 1e-12 * b.normal_force);
    EXPECT_LT((a.force - b.force).norm(), 1e-12 * b.normal_force);
    EXPECT_LT((a.moment - b.moment).norm(), 1e-12 * b.normal_force);
    EXPECT_NEAR(a.pressure, b.pressure, 1e-12 * b.pressure);
    EXPECT_EQ(a.points > 0 && both.points >= a.points, true);
  }
}

// A ball on a plate that is held at its edges: what the plate carries is the weight of both.
TEST(ContactShells, BallRestsOnAPlate) {
  std::string text =
      "gravity = [0, 0, -9.81]\n" + shell("damping = { mass = 5, stiffness = 1e-3 }\n", "set = \"top\"\n") +
      "[bodies.ball]\ntype = \"rigid\"\nmass = 0.1\ninertia = [1e-3, 1e-3, 1e-3]\nposition = [0.5, 0.4, 0.2101]\n"
      "[surfaces.ball]\nbody = \"ball\"\nshape = \"sphere\"\nradius = 0.2\n[contacts.c]\nsurfaces = [\"plate\", "
      "\"ball\"]\nstiffness = 1e6\ndamping = 20\n[joints.straight]\ntype = \"prismatic\"\nbodies = [\"ground\", "
      "\"ball\"]\nat = [0.5, 0.4, 0]\naxis = [0, 0, 1]\n" +
      kSettle + "6\n";
  for (const auto& [node, x, y] : {std::tuple{1, 0.0, 0.0}, {5, 1.0, 0.0}, {16, 0.0, 0.8}, {20, 1.0, 0.8}})
    text += fmt::format(
        "[joints.corner{0}]\ntype = \"spherical\"\na = {{ body = \"ground\", point = [{1}, {2}, 0] }}\nb = {{ body = "
        "\"plate\", node = {0} }}\n",
        node, x, y);
  const Simulation rests = simulated(text);
  EXPECT_NEAR(rests.value("c.force.z"), 0.981, 1e-4);
  double carried = 0;
  for (const int node : {1, 5, 16, 20}) carried += std::abs(rests.value(fmt::format("corner{}.force.z", node)));
  EXPECT_NEAR(carried, 9.81 * (0.1 + 800 * 0.02 * 0.8), 1e-2);
}

// ---- Symmetry of space

Vec3 turned(const Mat3& r, const double* x) { return r * Vec3(x[0], x[1], x[2]); }

/// A state turned about the origin, with its velocities.
State turned(const model::Mechanism& mechanism, const State& s, const Mat3& r) {
  State out = s;
  for (const model::BuiltBody& body : mechanism.bodies)
    for (Index n = 0; n < body.flexible->vertices(); ++n) {
      const auto q = static_cast<std::size_t>(body.flexible->configuration(n));
      const auto v = static_cast<std::size_t>(body.flexible->coordinate(n));
      Eigen::Map<Vec3>(&out.q[q]) = turned(r, &s.q[q]);
      Eigen::Map<Vec3>(&out.v[v]) = turned(r, &s.v[v]);
    }
  return out;
}

TEST(ContactShells, ForcesTurnWithEverything) {
  const std::string cable =
      "[bodies.rope]\ntype = \"cable\"\nstart = [0.1, 0.2, 0.025]\nend = [0.8, 0.6, 0.03]\nelements = 3\naxial = "
      "1e4\nbending = 0.01\nmass_per_length = 0.5\n[surfaces.rope]\nbody = \"rope\"\nshape = \"line\"\nradius = 0.02\n"
      "[contacts.c]\nsurfaces = [\"rope\", \"plate\"]\nstiffness = 1e4\nfriction = 0.3\ndamping = 2\noverlap = "
      "1\n[integrator]\nend = 1\n";
  const auto mechanism = built(shell("", "") + cable), other = built(shell("", "") + cable);
  const State before = anywhere(*mechanism, 3, 1e-3), now = anywhere(*mechanism, 4, 1e-3);
  const Mat3 r = rotation_exp({0.7, -1.1, 0.4});
  mechanism->system.accept(before.view());
  other->system.accept(turned(*other, before, r).view());
  const State there = turned(*other, now, r);
  std::vector<double> f(now.v.size()), g(now.v.size());
  State still = now, still_there = there;  // gravity and masses have no part in it
  for (State* s : {&still, &still_there}) std::fill(s->a.begin(), s->a.end(), 0.0);
  mechanism->system.residual(still.view(), f);
  other->system.residual(still_there.view(), g);
  const auto report = mechanism->surface_contacts.front().report(now.view());
  ASSERT_GT(report.points, 2);
  ASSERT_GT(report.friction_force, 0);
  const double size = *std::max_element(f.begin(), f.end());
  for (std::size_t i = 0; i < f.size(); i += 3) {
    const Vec3 difference = turned(r, &f[i]) - Vec3(g[i], g[i + 1], g[i + 2]);
    EXPECT_LT(difference.norm(), 1e-10 * size) << i;
  }
}

// ---- Mistakes

std::string mistake(const std::string& text) {
  Simulation simulation;
  return simulation.load_text(text, "model.toml").message;
}

TEST(ContactLines, MistakesAreNamed) {
  const std::string contact = "[contacts.c]\nsurfaces = [\"rope\", \"floor\"]\nstiffness = 1e3\n";
  const std::string end = "[integrator]\nend = 1\n";
  const auto has = [](const std::string& message, const std::string& part) {
    EXPECT_NE(message.find(part), std::string::npos) << message;
  };
  const std::string text = rope(0.1, 0.1) + kFloor + contact + end;
  has(mistake(text + "[surfaces.b]\nbody = \"rope\"\nshape = \"faces\"\n[contacts.d]\nsurfaces = [\"b\", "
                     "\"floor\"]\nstiffness = 1\n"),
      "no solid or shell");
  has(mistake(text + "[surfaces.b]\nbody = \"ground\"\nshape = \"line\"\nradius = 1\n[contacts.d]\nsurfaces = [\"b\", "
                     "\"rope\"]\nstiffness = 1\n"),
      "no cable or beam");
  has(mistake(rope(0.01, 0.1) + kFloor + contact + end), "overlap by 0.01");
  has(mistake(shell("position = [0, 0, 1]\n", "set = \"left\"\n") + kFloor +
              "[contacts.c]\nsurfaces = [\"plate\", \"floor\"]\nstiffness = 1\n" + end),
      "\"top\" and \"bottom\"");
  has(mistake(text + "[surfaces.b]\nbody = \"rope\"\nshape = \"line\"\nradius = -1\n"), "radius");
  has(mistake(text + "[surfaces.b]\nbody = \"rope\"\nshape = \"line\"\nradius = 1\ndivisions = 0\n"), "divisions");
}

}  // namespace contact_lines_test
}  // namespace espalier::dynamics

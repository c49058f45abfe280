// Faces of solids and shells, cables and beams in contact. Truth: central differences, Newton's third law, uniform
// stress.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "dynamics/contact/solid_contact.hpp"
#include "dynamics/model/built_model.hpp"
#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace contact_solid_test {

using contact::ContactReport;
using contact::SolidContact;

constexpr const char* kSteel = "material = { young = 1000, poisson = 0.3, density = 1 }\n";

std::string block(const std::string& name, const std::string& mesh, const std::string& more = "") {
  return fmt::format(
      "[bodies.{0}]\ntype = \"solid\"\nmesh = {{ part = \"block\", {1} }}\n{2}{3}\n[surfaces.{0}]\nbody = "
      "\"{0}\"\nshape = \"faces\"\n",
      name, mesh, kSteel, more);
}

const std::string kEnd = "[integrator]\nend = 1\n";
const std::string kLaw =
    "[contacts.c]\nsurfaces = [\"upper\", \"lower\"]\nstiffness = 300\nfriction = 0.4\ntangential_stiffness = 200\n"
    "tangential_damping = 0.5\ndamping = 0.3\noverlap = 1\n";

struct SolidCase {
  const char* name;
  std::string text;
  friend void PrintTo(const SolidCase& c, std::ostream* out) { *out << c.name; }
};

std::vector<SolidCase> solid_cases() {
  const std::string turned = "position = [0.07, 0.11, 0.47]\nrotation = [0.02, 0.03, 0.5]";
  const std::string rigid =
      "[bodies.ball]\ntype = \"rigid\"\nmass = 2\ninertia = [0.5, 0.6, 0.7]\nposition = [0.4, 0.5, {}]\nrotation = "
      "[0.1, "
      "0.2, 0.3]\n[surfaces.lower]\nbody = \"ball\"\n";
  const auto on_rigid = [&](double z, const std::string& shape) {
    return block("upper", "lx = 1, ly = 1, lz = 0.5, divisions = [2, 2, 1]") + fmt::format(fmt::runtime(rigid), z) +
           shape + kLaw + kEnd;
  };
  const std::string lower = block("lower", "lx = 1, ly = 1, lz = 0.5, divisions = [2, 2, 1]");
  const std::string lower20 = block("lower", "lx = 1, ly = 1, lz = 0.5, element = \"hex20\", divisions = [1, 1, 1]");
  const std::string upper = block("upper", "lx = 0.8, ly = 0.7, lz = 0.4, divisions = [2, 2, 1]", turned);
  const auto cable = [](const std::string& name, const std::string& more) {
    return fmt::format(
        "[bodies.{0}]\ntype = \"cable\"\nstart = [0.1, 0.3, 0.05]\nend = [0.8, 0.6, 0.06]\nelements = 3\nradius = "
        "0.05\n{1}{2}\n[surfaces.{0}]\nbody = \"{0}\"\nshape = \"line\"\nradius = 0.06\ndivisions = 2\n",
        name, kSteel, more);
  };
  const std::string beam = fmt::format(
      "[bodies.upper]\ntype = \"beam\"\nstart = [0.1, 0.3, 0.07]\nend = [0.8, 0.6, 0.08]\nelements = 3\nradius = "
      "0.05\n{}\n[surfaces.upper]\nbody = \"upper\"\nshape = \"line\"\nradius = 0.06\n",
      kSteel);
  const auto shell = [](const std::string& name, const std::string& more, int n = 2) {
    return fmt::format(
        "[bodies.{0}]\ntype = \"shell\"\norigin = [0, 0.1, 0]\nx = [0.9, 0.1, 0]\ny = [0, 0.8, 0.1]\nnx = {3}\nny = "
        "{3}\nthickness = 0.04\n{1}{2}\n[surfaces.{0}]\nbody = \"{0}\"\nshape = \"faces\"\n",
        name, kSteel, more, n);
  };
  const std::string frictionless =
      "[contacts.c]\nsurfaces = [\"upper\", \"lower\"]\nstiffness = 300\ndamping = 0.3\noverlap = 1\n";
  const std::string upper20 =
      block("upper", "lx = 0.8, ly = 0.7, lz = 0.4, element = \"hex20\", divisions = [1, 1, 1]", turned);
  return {
      {"hex8 on hex8", upper + lower + kLaw + kEnd},
      {"hex20 on hex8", upper20 + lower + kLaw + kEnd},
      {"hex8 on hex20", upper + lower20 + kLaw + kEnd},
      {"hex8 on sphere", on_rigid(-0.36, "shape = \"sphere\"\nradius = 0.4\n")},
      {"hex8 on box", on_rigid(-0.26, "shape = \"box\"\nsize = [0.5, 0.5, 0.6]\n")},
      {"hex8 on capsule", on_rigid(-0.26, "shape = \"capsule\"\nradius = 0.3\nlength = 0.5\naxis = [1, 0.1, 0]\n")},
      {"hex8 on plane", on_rigid(0.03, "shape = \"plane\"\nrotation = [-0.1, -0.2, 0]\n")},
      {"cable on sphere", cable("upper", "") + fmt::format(fmt::runtime(rigid), -0.36) +
                              "shape = \"sphere\"\nradius = 0.4\n" + kLaw + kEnd},
      {"cable on capsule", cable("upper", "") + fmt::format(fmt::runtime(rigid), -0.26) +
                               "shape = \"capsule\"\nradius = 0.3\nlength = 0.5\naxis = [0.1, 1, 0]\n" + kLaw + kEnd},
      {"beam on box",
       beam + fmt::format(fmt::runtime(rigid), -0.26) + "shape = \"box\"\nsize = [0.5, 0.5, 0.6]\n" + kLaw + kEnd},
      {"cable on hex8", cable("upper", "position = [0, 0, 0.5]") + lower + kLaw + kEnd},
      {"hex8 on cable", upper + cable("lower", "position = [0, 0, 0.43]") + kLaw + kEnd},
      {"cable on cable",
       cable("upper", "") + cable("lower", "position = [0.4, 0.1, -0.06]\nrotation = [0, 0, 0.6]") + kLaw + kEnd},
      {"beam on cable", beam + cable("lower", "position = [0.4, 0.1, -0.04]\nrotation = [0, 0, 0.6]") + kLaw + kEnd},
      {"cable on cable without friction", cable("upper", "") +
                                              cable("lower", "position = [0.4, 0.1, -0.06]\nrotation = [0, 0, 0.6]") +
                                              frictionless + kEnd},
      {"shell on sphere", shell("upper", "") + fmt::format(fmt::runtime(rigid), -0.33) +
                              "shape = \"sphere\"\nradius = 0.4\n" + kLaw + kEnd},
      {"shell on hex8", shell("upper", "position = [0, 0, 0.51]", 1) + lower + kLaw + kEnd},
      {"shell on shell", shell("upper", "position = [0.1, 0.2, 0.06]\nrotation = [0.01, -0.01, 0.3]", 1) +
                             shell("lower", "", 1) + kLaw + kEnd}};
}

class SolidPairs : public testing::TestWithParam<SolidCase> {};

contact::Contact& contact_of(model::Mechanism& mechanism) {
  EXPECT_EQ(mechanism.surface_contacts.front().parts.size(), 1U);
  return *mechanism.surface_contacts.front().parts.front();
}

TEST_P(SolidPairs, TangentIsThatOfDifferences) {
  const auto mechanism = built(GetParam().text);
  const State before = anywhere(*mechanism, 3, 0.002), s = anywhere(*mechanism, 4, 0.004);
  mechanism->system.update_pattern(s.q);
  for (const bool with_history : {false, true}) {
    if (with_history) mechanism->system.accept(before.view());
    mechanism->system.update_pattern(s.q);
    EXPECT_GT(contact_of(*mechanism).report(s.view()).points, 1);
    const JacobianCheck check = check_jacobians(mechanism->system, s);
    EXPECT_LT(check.largest(), 2e-6) << check.worst;
  }
}

TEST_P(SolidPairs, ForcesAreEqualAndOpposite) {
  std::string text = GetParam().text;
  const auto mechanism = built(text);
  mechanism->system.accept(anywhere(*mechanism, 3, 0.002).view());
  const State s = anywhere(*mechanism, 4, 0.004);
  std::vector<double> f(s.v.size()), without(s.v.size());
  mechanism->system.residual(s.view(), f);
  const ContactReport report = contact_of(*mechanism).report(s.view());
  contact_of(*mechanism).set_active(false);
  mechanism->system.residual(s.view(), without);
  Vec3 force = Vec3::Zero(), moment = Vec3::Zero();
  for (const model::BuiltBody& body : mechanism->bodies) {
    if (body.rigid != nullptr) {
      const auto at = static_cast<std::size_t>(body.rigid->coordinates()[0]);
      const auto part = [&](std::size_t k) { return f[at + k] - without[at + k]; };
      const Vec3 own(part(0), part(1), part(2));
      force += own;
      moment += body.rigid->position(s.q).cross(own) +
                rotation_matrix(body.rigid->quaternion(s.q)) * Vec3(part(3), part(4), part(5));
      continue;
    }
    for (Index n = 0; n < body.flexible->vertices(); ++n) {
      const auto row = static_cast<std::size_t>(body.flexible->coordinate(n));
      const auto place = static_cast<std::size_t>(body.flexible->configuration(n));
      const Vec3 own(f[row] - without[row], f[row + 1] - without[row + 1], f[row + 2] - without[row + 2]);
      // slopes and directors turn with the body: their forces have moments alone
      if (n % body.flexible->vertices_per_node() == 0) force += own;
      moment += Vec3(s.q[place], s.q[place + 1], s.q[place + 2]).cross(own);
    }
  }
  const double size = report.normal_force;
  EXPECT_GT(size, 1e-4);
  EXPECT_LT(force.norm(), 1e-12 * size);
  // Between solids friction acts on both sides of the gap.
  const bool solids = mechanism->bodies[0].flexible != nullptr && mechanism->bodies[1].flexible != nullptr;
  const bool line = GetParam().text.find("\"line\"") != std::string::npos;  // takes friction on its axis
  const double arm = 1.1 * report.penetration + (line ? 0.06 : 0);
  EXPECT_LT(moment.norm(), solids ? arm * report.friction_force + 1e-12 * size : 1e-12 * size);
}

INSTANTIATE_TEST_SUITE_P(Solids, SolidPairs, testing::ValuesIn(solid_cases()), [](const auto& instance) {
  std::string name = instance.param.name;
  for (char& c : name)
    if (c == ' ') c = '_';
  return name;
});

// ---- The contact patch test

struct PatchCase {
  const char* name;
  std::string lower, upper;  // divisions and element
  double poisson;
  friend void PrintTo(const PatchCase& c, std::ostream* out) { *out << c.name; }
};

constexpr double kStart = 1e-4;  // they overlap by so much at the start, so that something holds them

/// Two blocks, one on the other, on a rigid plane, under an even pressure.
std::string patch(const PatchCase& c, double pressure, double stiffness) {
  const auto body = [&](const char* name, const std::string& mesh, double z) {
    return fmt::format(
        "[bodies.{0}]\ntype = \"solid\"\nmesh = {{ part = \"block\", lx = 1, ly = 1, lz = 0.5, {1} }}\nmaterial = {{ "
        "young "
        "= 100, poisson = {2}, density = 1 }}\nposition = [0, 0, {3}]\n[forces.hold-{0}]\ntype = \"bushing\"\na = {{ "
        "body = "
        "\"ground\", point = [0.5, 0.5, {4}] }}\nb = {{ body = \"{0}\", face = \"z0\" }}\nstiffness = [1, 1, "
        "0]\nangular_stiffness = [0, 0, 1]\n",
        name, mesh, c.poisson, z, z);
  };
  return body("lower", c.lower, -kStart) + body("upper", c.upper, 0.5 - 2 * kStart) +
         fmt::format(
             "[surfaces.ground]\nbody = \"ground\"\nshape = \"plane\"\n[surfaces.bottom]\nbody = \"lower\"\nshape = "
             "\"faces\"\nset = \"z0\"\n[surfaces.low]\nbody = \"lower\"\nshape = \"faces\"\nset = "
             "\"z1\"\n[surfaces.high]\nbody "
             "= \"upper\"\nshape = \"faces\"\nset = \"z0\"\n[contacts.floor]\nsurfaces = [\"bottom\", "
             "\"ground\"]\nstiffness = "
             "{0}\n[contacts.middle]\nsurfaces = [\"high\", \"low\"]\nstiffness = {0}\n[forces.load]\ntype = "
             "\"pressure\"\nbody = \"upper\"\nface = \"z1\"\npressure = {1}\n[statics]\ntolerance = 1e-13\n",
             stiffness, pressure);
}

class ContactPatch : public testing::TestWithParam<PatchCase> {};

// St. Venant-Kirchhoff, stretches l (along z) and m: S_zz = E e, e_xx = -nu e_zz, P_zz = l S_zz = -p m^2. The pressure
// of the law counts on areas without stress, so the gap is P_zz / k.
TEST_P(ContactPatch, StressIsUniform) {
  constexpr double kPressure = 5, kStiffness = 1e4, kYoung = 100;
  const double nu = GetParam().poisson;
  double stretch = 1, wide = 1;
  for (int k = 0; k < 200; ++k) {
    const double e = 0.5 * (stretch * stretch - 1);
    wide = std::sqrt(1 - 2 * nu * e);
    const double p = stretch * kYoung * e + kPressure * wide * wide;
    const double slope = kYoung * (e + stretch * stretch) - 2 * nu * stretch * kPressure;
    stretch -= p / slope;
  }
  const double gap = kPressure * wide * wide / kStiffness;
  Simulation simulation;
  ASSERT_TRUE(simulation.load_text(patch(GetParam(), kPressure, kStiffness), "patch.toml").ok());
  const Status status = simulation.run();
  ASSERT_TRUE(status.ok()) << status.message;
  const SimulationFrame frame = simulation.frame();
  const SimulationMesh& mesh = simulation.mesh();
  std::int64_t of_lower = 0;  // points
  for (std::size_t k = 0; k < mesh.body.size(); ++k)
    if (mesh.body[k] == 0)
      for (std::int64_t c = mesh.offsets[k]; c < mesh.offsets[k + 1]; ++c)
        of_lower = std::max(of_lower, mesh.connectivity[static_cast<std::size_t>(c)] + 1);
  double worst = 0;
  for (std::size_t i = 0; i < frame.points.size(); i += 3) {
    const double blocks = static_cast<std::int64_t>(i / 3) < of_lower ? 1 : 2;
    const double x0 = frame.points[i] - frame.displacement[i], y0 = frame.points[i + 1] - frame.displacement[i + 1],
                 z0 = frame.points[i + 2] - frame.displacement[i + 2] + blocks * kStart;
    const double x = 0.5 + wide * (x0 - 0.5), y = 0.5 + wide * (y0 - 0.5), z = stretch * z0 - blocks * gap;
    worst = std::max(
        {worst, std::abs(frame.points[i] - x), std::abs(frame.points[i + 1] - y), std::abs(frame.points[i + 2] - z)});
  }
  EXPECT_LT(worst, 1e-10);
  EXPECT_NEAR(simulation.value("middle.pressure"), kPressure * wide * wide, 1e-10 * kPressure);
  EXPECT_NEAR(simulation.value("middle.area"), 1, 1e-10);
  EXPECT_NEAR(simulation.value("middle.force.z"), -kPressure * wide * wide, 1e-9);
}

INSTANTIATE_TEST_SUITE_P(
    Blocks, ContactPatch,
    testing::Values(PatchCase{"hex8_matching", "divisions = [2, 2, 1]", "divisions = [2, 2, 1]", 0},
                    PatchCase{"hex8_finer_above", "divisions = [2, 3, 1]", "divisions = [5, 4, 2]", 0.3},
                    PatchCase{"hex8_finer_below", "divisions = [5, 4, 1]", "divisions = [2, 3, 1]", 0.3},
                    PatchCase{"hex20_on_hex8", "divisions = [3, 2, 1]", "element = \"hex20\", divisions = [2, 3, 1]",
                              0.3},
                    PatchCase{"hex20_on_hex20", "element = \"hex20\", divisions = [3, 2, 1]",
                              "element = \"hex20\", divisions = [2, 3, 1]", 0.3}),
    [](const auto& instance) { return instance.param.name; });

// ---- Augmented Lagrangian

// What the cheap test throws away is nowhere over the face; and a projection that begins elsewhere ends at the same
// place. Truth: the projection from the middle.
TEST(ContactSolids, PointsOverAFaceAreNotThrownAway) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> any(-1, 1);
  constexpr double kBelow = 0.2, kAbove = 0.1;
  int over = 0, thrown = 0;
  for (const auto& [type, places] : std::vector<std::pair<ElementType, std::vector<std::array<double, 2>>>>{
           {ElementType::tri3, {{0, 0}, {1, 0}, {0, 1}}},
           {ElementType::quad4, {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}}},
           {ElementType::tri6, {{0, 0}, {1, 0}, {0, 1}, {0.5, 0}, {0.5, 0.5}, {0, 0.5}}},
           {ElementType::quad8, {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}, {0, -1}, {1, 0}, {0, 1}, {-1, 0}}}})
    for (int k = 0; k < 2000; ++k) {
      contact::SurfaceFace face;
      face.type = type;
      for (const auto& [a, b] : places) {
        face.places.push_back(0);
        face.x.emplace_back(a + 0.05 * any(random), b + 0.05 * any(random), 0.15 * any(random));
      }
      const contact::Vec3 x(2.5 * any(random), 2.5 * any(random), 0.6 * any(random));
      const contact::FaceProjection p = project_on_face(face, x);
      const bool kept = may_be_over(face, x, kBelow, kAbove);
      thrown += kept ? 0 : 1;
      if (p.outside > 0.02) continue;
      const std::array<double, 2> near = {p.xi[0] + 0.05 * any(random), p.xi[1] + 0.05 * any(random)};
      const contact::FaceProjection again = project_on_face(face, x, &near);
      EXPECT_NEAR(again.xi[0], p.xi[0], 1e-11) << k;
      EXPECT_NEAR(again.xi[1], p.xi[1], 1e-11) << k;
      const contact::FacePlace there = face_place(face, p.xi.data());
      const double height = there.normal_area().normalized().dot(x - there.x);
      if (height < -kBelow || height > kAbove) continue;
      ++over;
      EXPECT_TRUE(kept) << static_cast<int>(type) << " " << k;
    }
  EXPECT_GT(over, 100);
  EXPECT_GT(thrown, 2000);
}

TEST(ContactSolids, ChosenPenetrationIsKept) {
  const PatchCase c{"", "divisions = [2, 2, 1]", "divisions = [3, 3, 1]", 0.3};
  std::string text = patch(c, 5, 500);  // a hundredth of the height, without
  const Simulation soft = simulated(text);
  EXPECT_GT(soft.value("middle.penetration"), 5e-3);
  const std::string key = "stiffness = 500\n[forces.load]";
  ASSERT_NE(text.find(key), std::string::npos);
  text.replace(text.find(key), key.size(), "stiffness = 500\npenetration = 1e-7\n[forces.load]");
  const Simulation exact = simulated(text);
  EXPECT_LE(exact.value("middle.penetration"), 1e-7);
  EXPECT_NEAR(exact.value("middle.force.z"), soft.value("middle.force.z"), 1e-6 * 5);
}

}  // namespace contact_solid_test
}  // namespace espalier::dynamics

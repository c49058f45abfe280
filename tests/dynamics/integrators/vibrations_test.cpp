// Modes of systems of any size against the dense method, and a beam's closed form.
#include "dynamics/integrators/vibrations.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "dynamics/model/built_model.hpp"

namespace espalier::dynamics {
namespace vibrations_test {

// A block of solid elements, clamped at its left end by a fixed joint (multipliers), with a rigid body at the other.
std::string block_on_a_wall(const std::string& damping) {
  return R"(
[materials.steel]
young = 2e11
poisson = 0.3
density = 7800
[bodies.block]
type = "solid"
mesh = { part = "block", lx = 1.0, ly = 0.1, lz = 0.06, divisions = [8, 2, 2] }
material = "steel"
)" + damping +
         R"(
[bodies.weight]
type = "rigid"
mass = 5
box = [0.1, 0.1, 0.1]
position = [1.05, 0, 0]
[markers]
wall = { body = "block", face = "x0" }
tip = { body = "block", face = "x1" }
[joints]
clamp = { type = "fixed", a = { body = "ground" }, b = "wall" }
load = { type = "fixed", a = "tip", b = { body = "weight" } }
[integrator]
end = 1
)";
}

struct Compared {
  std::vector<Mode> dense;  // all of them
  Vibrations sparse;
  Index constraints = 0;
};

Compared compare(const std::string& text, Index count) {
  const std::unique_ptr<model::Mechanism> mechanism = built(text);
  Equations equations(mechanism->system);
  State s(mechanism->system.sizes());
  mechanism->system.initial(s.q, s.v);
  Options solver;
  solver.threads = 2;
  const Index all = equations.sizes().velocity;
  Compared out{small_vibrations_by(equations, s, all, nullptr).modes, small_vibrations_by(equations, s, count, &solver),
               mechanism->system.sizes().constraints};
  return out;
}

TEST(Vibrations, WithoutDampingAreThoseOfTheDenseMethod) {
  const Compared c = compare(block_on_a_wall(""), 20);
  ASSERT_EQ(c.sparse.modes.size(), 20U);
  EXPECT_EQ(c.constraints, 12 + 2 * (3 * 9 - 6));  // two joints, and two faces of 9 nodes that are rigid
  EXPECT_TRUE(c.sparse.notice.empty()) << c.sparse.notice;
  for (std::size_t i = 0; i < 20; ++i) {
    EXPECT_NEAR(c.sparse.modes[i].frequency / c.dense[i].frequency, 1, 1e-9) << i;
    EXPECT_EQ(c.sparse.modes[i].damping_ratio, 0);
  }
  // Shapes: the same direction (frequencies here are apart).
  for (const std::size_t i : {0U, 1U, 4U}) {
    const std::vector<double>&a = c.sparse.modes[i].shape, &b = c.dense[i].shape;
    ASSERT_EQ(a.size(), b.size());
    double ab = 0, aa = 0, bb = 0;
    for (std::size_t k = 0; k < a.size(); ++k) ab += a[k] * b[k], aa += a[k] * a[k], bb += b[k] * b[k];
    EXPECT_NEAR(std::abs(ab) / std::sqrt(aa * bb), 1, 1e-4) << i;
  }
}

TEST(Vibrations, DampingIsTakenInTheSpaceOfTheLowestModes) {
  const Compared c = compare(block_on_a_wall("damping = { stiffness = 2e-5, mass = 3 }"), 8);
  ASSERT_EQ(c.sparse.modes.size(), 8U);
  EXPECT_NE(c.sparse.notice.find("damping is taken in the space of"), std::string::npos);
  for (std::size_t i = 0; i < 8; ++i) {
    EXPECT_NEAR(c.sparse.modes[i].frequency / c.dense[i].frequency, 1, 1e-4) << i;
    EXPECT_NEAR(c.sparse.modes[i].damping_ratio / c.dense[i].damping_ratio, 1, 1e-3) << i;
    EXPECT_GT(c.dense[i].damping_ratio, 1e-3);
  }
}

TEST(Vibrations, AFreeBodyHasSixRigidMotions) {
  std::string text = block_on_a_wall("");
  text.erase(text.find("[bodies.weight]"), text.find("[integrator]") - text.find("[bodies.weight]"));
  const Compared c = compare(text, 9);
  ASSERT_EQ(c.sparse.modes.size(), 9U);
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_EQ(c.sparse.modes[i].frequency, 0) << i;
    EXPECT_EQ(c.dense[i].frequency, 0) << i;
  }
  EXPECT_NEAR(c.sparse.modes[6].frequency, c.dense[6].frequency, 1e-9 * c.dense[6].frequency);
  for (std::size_t i = 6; i < 9; ++i) EXPECT_GT(c.sparse.modes[i].frequency, 100) << i;
  // A free beam's first bending: (4.730 / L)^2 sqrt(E I / (rho A)) / (2 pi), about the thinner side; shear makes it
  // less.
  const double euler =
      std::pow(4.730040744862704, 2) * std::sqrt(2e11 * 0.06 * 0.06 / 12 / 7800) / (2 * std::numbers::pi);
  EXPECT_LT(c.sparse.modes[6].frequency, 3 * euler);
  EXPECT_GT(c.sparse.modes[6].frequency, 0.9 * euler);
}

// A thin wire, clamped: the frequencies of its section lie 10^8 above those of bending. Truth: Euler and Bernoulli,
// f = (b / L)^2 / (2 pi) sqrt(E I / (rho A)) = (b / L)^2 r / (4 pi) sqrt(E / rho), each twice; 12 elements are exact to
// some 1e-5 of the lowest.
TEST(Vibrations, OfThinWires) {
  constexpr double kLength = 0.5;
  for (const double radius : {1e-3, 1e-4, 3e-5}) {
    const std::unique_ptr<model::Mechanism> mechanism = built(
        fmt::format("[bodies.wire]\ntype = \"beam\"\nstart = [0, 0, 0]\nend = [{}, 0, 0]\nelements = 12\nradius = {}\n"
                    "material = {{ young = 2.1e11, poisson = 0.3, density = 7850 }}\n[joints.clamp]\ntype = \"fixed\"\n"
                    "a = {{ body = \"ground\" }}\nb = {{ body = \"wire\", node = 1 }}\n[integrator]\nend = 1\n",
                    kLength, radius));
    Equations equations(mechanism->system);
    State s(mechanism->system.sizes());
    mechanism->system.initial(s.q, s.v);
    const Vibrations found = small_vibrations(equations, s, 6, {});
    ASSERT_EQ(found.modes.size(), 6U);
    const double roots[] = {1.87510406871196, 4.69409113297418, 7.85475743823761};
    for (std::size_t i = 0; i < 6; ++i) {
      const double euler =
          std::pow(roots[i / 2] / kLength, 2) * radius / (4 * std::numbers::pi) * std::sqrt(2.1e11 / 7850);
      EXPECT_NEAR(found.modes[i].frequency / euler, 1, i < 2 ? 1e-4 : 2e-3) << radius << ", mode " << i;
      EXPECT_EQ(found.modes[i].damping_ratio, 0);
    }
  }
}

}  // namespace vibrations_test
}  // namespace espalier::dynamics

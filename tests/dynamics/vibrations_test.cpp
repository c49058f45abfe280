// Modes of systems of any size against the dense method, and a beam's closed form.
#include "dynamics/integrators/vibrations.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "dynamics/built_model.hpp"

namespace espalier::dynamics {
namespace {

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
  std::vector<Mode> dense;
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
  Compared out{eigenfrequencies(equations, s), small_vibrations(equations, s, count, solver),
               mechanism->system.sizes().constraints};
  return out;
}

TEST(Vibrations, WithoutDampingAreThoseOfTheDenseMethod) {
  const Compared c = compare(block_on_a_wall(""), 20);
  ASSERT_EQ(c.sparse.modes.size(), 20U);
  EXPECT_EQ(c.constraints, 12);
  EXPECT_TRUE(c.sparse.notice.empty()) << c.sparse.notice;
  for (std::size_t i = 0; i < 20; ++i) {
    // The dense method takes an unsymmetric matrix with entries of the size of the largest omega^2: rounding of them.
    EXPECT_NEAR(c.sparse.modes[i].frequency / c.dense[i].frequency, 1, 2e-5) << i;
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
  const double elastic = c.dense[12].frequency;  // the dense method has each rigid motion twice
  for (std::size_t i = 0; i < 6; ++i) EXPECT_LE(c.sparse.modes[i].frequency, 1e-4 * elastic) << i;
  for (std::size_t i = 6; i < 9; ++i) EXPECT_GT(c.sparse.modes[i].frequency, 100) << i;
  // A free beam's first bending: (4.730 / L)^2 sqrt(E I / (rho A)) / (2 pi), about the thinner side; shear makes it
  // less.
  const double euler =
      std::pow(4.730040744862704, 2) * std::sqrt(2e11 * 0.06 * 0.06 / 12 / 7800) / (2 * std::numbers::pi);
  EXPECT_LT(c.sparse.modes[6].frequency, 3 * euler);
  EXPECT_GT(c.sparse.modes[6].frequency, 0.9 * euler);
}

}  // namespace
}  // namespace espalier::dynamics

// Models of mesh files of others, where they are present (not part of the repository).
#include <gtest/gtest.h>

#include <cmath>

#include "dynamics/model/model_common.hpp"
#include "places.hpp"

namespace espalier::dynamics {
namespace {

// Crank and connecting rod of C3D20 elements without any named faces: joints hold on to cylinders found by their
// geometry.
const std::string kEngine = R"toml([bodies.crank]
type = "solid"
mesh = { file = "exudyn_crank.inp" }
damping = { stiffness = 1e-6 }
[bodies.rod]
type = "solid"
mesh = { file = "exudyn_conrod.inp" }
damping = { stiffness = 1e-6 }
position = [0, 0.03, -0.01]
[bodies.piston]
type = "rigid"
mass = 0.05
box = [0.02, 0.02, 0.02]
position = [0, 0.11, -0.005]
[markers]
journal = { body = "crank", bore = { point = [0, 0, 0.015], radius = 0.005, length = 0.01 } }
pin = { body = "crank", bore = { point = [0, 0.03, -0.005], radius = 0.005, length = 0.01 }, axis = [0, 0, 1] }
big_eye = { body = "rod", bore = { point = [0, 0, 0.005], radius = 0.005 } }
small_eye = { body = "rod", bore = { point = [0, 0.08, 0.005], radius = 0.005 } }
[joints]
bearing = { type = "revolute", a = { body = "ground", point = [0, 0, 0.015], axis = [0, 0, 1] }, b = "journal" }
motor = { type = "rotation-motor", a = { body = "ground", axis = [0, 0, 1] }, b = "journal", motion = "-100*ramp(t, 0, 0.002)" }
crank_pin = { type = "revolute", a = "pin", b = "big_eye" }
wrist_pin = { type = "point-on-line", a = { body = "piston", axis = [0, 0, 1] }, b = "small_eye" }
cylinder = { type = "prismatic", a = { body = "ground", axis = [0, 1, 0] }, b = { body = "piston", axis = [0, 1, 0] } }
[integrator]
method = "generalized-alpha"
step = 2e-4
spectral_radius = 0.6
end = 2e-3
)toml";

TEST(ModelMeshes, SliderCrankOfExudynFollowsTheRigidMotion) {
  const std::string folder = (espalier::test::shared_data() / "mesh").string();
  if (!std::filesystem::exists(folder + "/exudyn_crank.inp")) GTEST_SKIP() << "no meshes in " << folder;
  Simulation s;
  Status status = s.load_text(kEngine, folder + "/engine.toml");  // meshes are looked for beside the text
  if (status.ok()) status = s.run();
  ASSERT_TRUE(status.ok()) << status.message;
  EXPECT_EQ(s.summary().velocities, 3 * (665 + 935) + 6);
  // The piston is where rigid parts would have it, up to what steel parts of this size give way while they are run up
  // in 2 ms: some micrometres (measured: 2.6).
  const double angle = 100 * 0.001, r = 0.03, l = 0.08;  // ramp(0.002, 0, 0.002) = 0.001
  const double rigid = r * std::cos(angle) + std::sqrt(l * l - r * r * std::sin(angle) * std::sin(angle));
  EXPECT_NEAR(s.value("piston.position.y"), rigid, 1e-5);
}

// models/real/wheelset.toml. Truth: INDEX.md's node count; angular momentum J omega of a wheelset that turns as a rigid
// body, with J = 2 E / omega^2 of its kinetic energy.
TEST(ModelMeshes, WheelsetTurns) {
  const std::string model = (espalier::test::source_folder() / "models/real/wheelset.toml").string();
  if (!std::filesystem::exists(espalier::test::shared_data() / "mesh/sfepy_wheelset.vtk"))
    GTEST_SKIP() << "no meshes in " << espalier::test::shared_data();
  Simulation s;
  const Status status = s.load(model);
  ASSERT_TRUE(status.ok()) << status.message;
  EXPECT_EQ(s.summary().velocities, 3 * 5457);
  const double omega = 60.4, inertia = 2 * s.summary().energy_begin.kinetic / (omega * omega);
  EXPECT_NEAR(s.value("wheelset.angular_momentum.x"), inertia * omega, 1e-9 * inertia * omega);
}

// Truth: a flat face of equal squares has its area mean in its middle, and a selection of its 441 nodes keeps it there.
TEST(ModelMeshes, LargeFaceSetsAreThinnedUnlessTold) {
  for (const int most : {0, 240}) {
    const Simulation s = simulated(R"([bodies.block]
type = "solid"
mesh = { part = "block", lx = 0.1, ly = 1, lz = 1, divisions = [1, 20, 20] }
material = { young = 1e9, density = 1000 }
[markers.end]
body = "block"
face = "x1"
most_nodes = )" + std::to_string(most) +
                                   R"(
[integrator]
end = 1e-9
)");
    for (const char* axis : {"end.position.y", "end.position.z"}) EXPECT_NEAR(s.value(axis), 0.5, 1e-12) << most;
  }
}

}  // namespace
}  // namespace espalier::dynamics

// Shells and cables on a GPU, most often an emulated one, with the vectors of BDF. Truth: the host.
#include <gtest/gtest.h>

#include "dynamics/device/device_run.hpp"
#include "dynamics/integrators/bdf.hpp"
#include "dynamics/model/built_model.hpp"
#include "solver/gpu/gpu_fixture.hpp"

namespace espalier::dynamics {
namespace {

using test::Course;
using test::Place;
using test::RunResult;

/// A weight on a cable, and a soft plate that swings about two of its corners.
const std::string kSwings = R"(
gravity = [0, 0, -9.81]
[bodies.cable]
type = "cable"
start = [0, 0, 0]
end = [1.6, 0, 0]
elements = 16
axial = 1e4
bending = 0.5
mass_per_length = 0.3
damping = { stiffness = 1e-4 }
[bodies.weight]
type = "rigid"
mass = 0.2
box = [0.05, 0.05, 0.05]
position = [1.6, 0, 0]
[bodies.plate]
type = "shell"
position = [0, 1, 0]
x = [1, 0, 0]
y = [0, 0.5, 0]
nx = 6
ny = 3
thickness = 0.02
material = { law = "neo-hookean", young = 1e7, poisson = 0.3, density = 1000 }
damping = { stiffness = 1e-4, mass = 0.1 }
[joints]
hook = { type = "spherical", a = { body = "ground" }, b = { body = "cable", node = 1 } }
knot = { type = "spherical", a = { body = "cable", node = -1 }, b = { body = "weight", point = [0, 0, 0] } }
hinge1 = { type = "spherical", a = { body = "ground", point = [0, 1, 0] }, b = { body = "plate", node = 1 } }
hinge2 = { type = "spherical", a = { body = "ground", point = [1, 1, 0] }, b = { body = "plate", node = 7 } }
[integrator]
end = 2e-3
)";

RunResult swung(const Course& course) {
  BdfOptions options;
  options.max_order = 3;
  options.relative = 1e-5;
  options.absolute = 1e-9;
  options.absolute_velocity = 1e-6;
  constexpr double kEnd = 2e-3;
  return test::run_there([] { return built(kSwings); }, kEnd, course,
                         [&](Equations& equations) { return BdfIntegrator(equations, options); });
}

TEST(DeviceAncf, ShellsAndCablesGoAsOnTheHost) {
  const RunResult host = swung({.place = Place::host}), gpu = swung({}), again = swung({});
  EXPECT_EQ(host.steps_on_device, 0);
  EXPECT_TRUE(gpu.on_device_at_end);
  EXPECT_EQ(gpu.steps_on_device, gpu.counts.steps);
  EXPECT_EQ(gpu.counts.steps, host.counts.steps);
  EXPECT_EQ(gpu.counts.newton_iterations, host.counts.newton_iterations);
  test::expect_same(gpu, host, 1e-10);
  EXPECT_EQ(again.end.q, gpu.end.q);
  EXPECT_EQ(again.end.v, gpu.end.v);
}

// The factor is lost in the middle of a step.
TEST(DeviceAncf, TheHostTakesAStepOver) {
  const RunResult host = swung({.place = Place::host}), gpu = swung({.fails_after = 3});
  EXPECT_FALSE(gpu.on_device_at_end);
  EXPECT_GT(gpu.steps_on_device, 0);
  test::expect_same(gpu, host, 1e-7);
}

class DeviceAncfOnGpu : public espalier::test::OnGpu {};

TEST_F(DeviceAncfOnGpu, ShellsAndCablesGoAsOnTheHost) {
  const RunResult host = swung({.place = Place::host}), gpu = swung({.place = Place::gpu}),
                  again = swung({.place = Place::gpu});
  EXPECT_TRUE(gpu.on_device_at_end);
  test::expect_same(gpu, host, 1e-7);
  EXPECT_EQ(again.end.q, gpu.end.q);
  EXPECT_EQ(again.end.v, gpu.end.v);
}

}  // namespace
}  // namespace espalier::dynamics

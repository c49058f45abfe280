// The vectors of BDF on a GPU, here an emulated one. Truth: the host.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "built_model.hpp"
#include "device_common.hpp"
#include "dynamics/integrators/bdf.hpp"
#include "dynamics/integrators/initial.hpp"
#include "emulated_device.hpp"

namespace espalier::dynamics {
namespace {

using test::difference;

AssembledSystem* the_twin = nullptr;
int sends_left = -1;

std::unique_ptr<DeviceAssembly> make_emulated(int, base::ThreadPool*) {
  return std::make_unique<test::EmulatedAssembly>(*the_twin, &sends_left);
}

struct RunResult {
  State end;
  IntegratorCounts counts;
  int steps_on_device = 0;
  long turns = 0;
  bool on_device_at_end = false;
};

/// How a run is to go on the emulated GPU.
struct Course {
  bool on_device = true;
  int fails_after = -1;  ///< factorizations there
  int sends = -1;        ///< vectors that it can be sent before it fails
  int save_after = -1;   ///< steps: what save() writes is restored
  double relative = 1e-5;
};

RunResult run_built(const std::function<std::unique_ptr<model::Mechanism>()>& build, double end, const Course& course) {
  const auto mechanism = build(), twin = build();
  AssembledSystem& system = mechanism->system;
  the_twin = &twin->system;
  sends_left = course.sends;
  const Sizes sizes = system.sizes();
  auto owned = std::make_unique<test::EmulatedSolver>(sizes.velocity + sizes.constraints);
  owned->fail_after(course.fails_after);
  Equations equations(system, std::move(owned));
  State s(sizes);
  system.initial(s.q, s.v);
  make_consistent(equations, s);
  BdfOptions options;
  options.max_order = 3;
  options.relative = course.relative;
  options.absolute = 1e-9;
  options.absolute_velocity = 1e-6;
  BdfIntegrator bdf(equations, options);
  bdf.start(s);
  if (course.on_device) equations.allow_device(make_emulated);
  RunResult result;
  int steps = 0;
  while (bdf.state().t < end) {
    (void)bdf.step(end);
    if (bdf.on_device()) ++result.steps_on_device;
    if (++steps != course.save_after) continue;
    std::vector<double> saved;
    bdf.save(saved);
    ConstSpan in = saved;
    bdf.restore(in);
    EXPECT_TRUE(in.empty());
  }
  result.end = bdf.state();
  result.counts = bdf.counts();
  result.turns = equations.counts().turns;
  result.on_device_at_end = bdf.on_device();
  return result;
}

RunResult run_model(const std::string& name, const std::vector<std::string>& overrides, double end,
                    const Course& course) {
  return run_built([&] { return test::built_from(name, overrides, 1); }, end, course);
}

const std::vector<std::string> kSmallEngine = {"parameters.unknowns=1000", "parameters.run_up=0.001"};

void expect_same(const RunResult& gpu, const RunResult& host, double tolerance) {
  EXPECT_LT(difference(gpu.end.q, host.end.q), tolerance);
  EXPECT_LT(difference(gpu.end.v, host.end.v), 1e2 * tolerance);
  EXPECT_LT(difference(gpu.end.lambda, host.end.lambda), 1e4 * tolerance);
}

TEST(DeviceMotion, RecordsKeepWhatIsNoNumber) {
  std::vector<double> x = {3, std::nan(""), -5, 1};
  MotionArrays arrays;
  arrays.v = x.data();
  const MotionMeasure what{.largest = {&MotionArrays::v}, .x = {&MotionArrays::v}, .weight = {}};
  MotionRecord first{}, second{}, all{};
  for (const std::size_t i : {0U, 1U}) what.add(arrays, i, first);
  for (const std::size_t i : {2U, 3U}) what.add(arrays, i, second);
  EXPECT_EQ(second.largest[0], 5);
  EXPECT_EQ(second.square[0], 26);
  for (const MotionRecord* part : {&first, &second}) MotionMeasure::join(all, *part);
  EXPECT_TRUE(std::isnan(all.largest[0]));
  EXPECT_TRUE(std::isnan(all.square[0]));
  EXPECT_EQ(all.largest[1], 0);
}

// A rigid piston, joints and a motor on the host; two flexible bodies there.
TEST(DeviceMotion, EngineGoesAsOnTheHost) {
  constexpr double kEnd = 3e-6;
  const RunResult host = run_model("engine.toml", kSmallEngine, kEnd, {.on_device = false});
  const RunResult gpu = run_model("engine.toml", kSmallEngine, kEnd, {});
  EXPECT_EQ(host.steps_on_device, 0);
  EXPECT_TRUE(gpu.on_device_at_end);
  EXPECT_EQ(gpu.steps_on_device, gpu.counts.steps);
  EXPECT_EQ(gpu.counts.steps, host.counts.steps);
  EXPECT_EQ(gpu.counts.newton_iterations, host.counts.newton_iterations);
  expect_same(gpu, host, 1e-10);
  const RunResult again = run_model("engine.toml", kSmallEngine, kEnd, {});
  EXPECT_EQ(again.end.q, gpu.end.q);
  EXPECT_EQ(again.end.v, gpu.end.v);
}

// Guides act on faces of its links, and there is gravity.
TEST(DeviceMotion, ChainGoesAsOnTheHost) {
  constexpr double kEnd = 1e-4;
  const std::vector<std::string> small = {"parameters.unknowns=1500"};
  const RunResult host = run_model("chain.toml", small, kEnd, {.on_device = false}),
                  gpu = run_model("chain.toml", small, kEnd, {});
  EXPECT_GT(gpu.steps_on_device, 0);
  EXPECT_EQ(gpu.counts.steps, host.counts.steps);
  expect_same(gpu, host, 1e-10);
}

// The mass of a rigid body stands in W though nothing declares its diagonal.
TEST(DeviceMotion, TopOnAFlexibleArmGoesAsOnTheHost) {
  constexpr double kEnd = 2e-4;
  const auto build = [] { return built(test::kTopOnAnArm); };
  const RunResult host = run_built(build, kEnd, {.on_device = false}), gpu = run_built(build, kEnd, {});
  EXPECT_TRUE(gpu.on_device_at_end);
  EXPECT_EQ(gpu.counts.steps, host.counts.steps);
  expect_same(gpu, host, 1e-10);
}

// A factor that bodies have turned with is the host's, and so are the vectors while it serves.
TEST(DeviceMotion, TurnedFactorsAreTheHosts) {
  constexpr double kEnd = 8.3e-5;
  const RunResult host = run_model("engine.toml", kSmallEngine, kEnd, {.on_device = false});
  const RunResult gpu = run_model("engine.toml", kSmallEngine, kEnd, {});
  EXPECT_GT(gpu.turns, 0);
  EXPECT_LT(gpu.steps_on_device, gpu.counts.steps);
  EXPECT_TRUE(gpu.on_device_at_end);
  expect_same(gpu, host, 1e-7);
}

// The factor is lost in the middle of a step.
TEST(DeviceMotion, TheHostTakesAStepOver) {
  constexpr double kEnd = 1e-6;
  const RunResult host = run_model("engine.toml", kSmallEngine, kEnd, {.on_device = false});
  for (const int after : {0, 1, 3}) {
    SCOPED_TRACE(after);
    const RunResult gpu = run_model("engine.toml", kSmallEngine, kEnd, {.fails_after = after});
    EXPECT_FALSE(gpu.on_device_at_end);
    EXPECT_EQ(gpu.steps_on_device > 0, after > 1);
    expect_same(gpu, host, 1e-9);
  }
}

// The GPU fails while the vectors enter it, or in what the same step does there then.
TEST(DeviceMotion, TheHostGoesOnWhereTheVectorsCannotEnter) {
  constexpr double kEnd = 1e-6;
  const RunResult host = run_model("engine.toml", kSmallEngine, kEnd, {.on_device = false});
  for (const int sends : {0, 3, 9, 14}) {
    SCOPED_TRACE(sends);
    const RunResult gpu = run_model("engine.toml", kSmallEngine, kEnd, {.sends = sends});
    EXPECT_FALSE(gpu.on_device_at_end);
    expect_same(gpu, host, 1e-9);
  }
}

// A run that is saved goes on with the bits of the one that was restored: both begin on the host again.
TEST(DeviceMotion, GoesOnAfterARestart) {
  constexpr double kEnd = 1e-6;
  const RunResult through = run_model("engine.toml", kSmallEngine, kEnd, {}),
                  restored = run_model("engine.toml", kSmallEngine, kEnd, {.save_after = 6});
  EXPECT_TRUE(restored.on_device_at_end);
  expect_same(restored, through, 1e-7);
}

}  // namespace
}  // namespace espalier::dynamics

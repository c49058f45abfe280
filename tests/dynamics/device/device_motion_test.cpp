// The vectors of BDF on a GPU, most often an emulated one. Truth: the host.
#include <gtest/gtest.h>

#include <cmath>

#include "dynamics/device/device_run.hpp"
#include "dynamics/integrators/bdf.hpp"
#include "dynamics/model/built_model.hpp"
#include "solver/gpu/gpu_fixture.hpp"

namespace espalier::dynamics {
namespace {

using test::Course;
using test::expect_same;
using test::kSmallEngine;
using test::Place;
using test::RunResult;

RunResult run_built(const test::Build& build, double end, const Course& course) {
  BdfOptions options;
  options.max_order = 3;
  options.relative = 1e-5;
  options.absolute = 1e-9;
  options.absolute_velocity = 1e-6;
  return test::run_there(build, end, course, [&](Equations& equations) { return BdfIntegrator(equations, options); });
}

RunResult run_model(const std::string& name, const std::vector<std::string>& overrides, double end,
                    const Course& course) {
  return run_built([&] { return test::built_from(name, overrides, 1); }, end, course);
}

TEST(DeviceMotion, RecordsKeepWhatIsNoNumber) {
  std::vector<double> x = {3, std::nan(""), -5, 1};
  MotionArrays arrays;
  arrays.v = x.data();
  const MotionMeasure what{.largest = {&MotionArrays::v}, .sums = {{&MotionArrays::v}}};
  MotionRecord first{}, second{}, all{};
  for (const std::size_t i : {0U, 1U}) what.add(arrays, i, first);
  for (const std::size_t i : {2U, 3U}) what.add(arrays, i, second);
  EXPECT_EQ(second.largest[0], 5);
  EXPECT_EQ(second.sum[0], 26);
  for (const MotionRecord* part : {&first, &second}) MotionMeasure::join(all, *part);
  EXPECT_TRUE(std::isnan(all.largest[0]));
  EXPECT_TRUE(std::isnan(all.sum[0]));
  EXPECT_EQ(all.largest[1], 0);
}

// A rigid piston, joints and a motor on the host; two flexible bodies there.
TEST(DeviceMotion, EngineGoesAsOnTheHost) {
  constexpr double kEnd = 3e-6;
  const RunResult host = run_model("engine.toml", kSmallEngine, kEnd, {.place = Place::host});
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
  const RunResult host = run_model("chain.toml", small, kEnd, {.place = Place::host}),
                  gpu = run_model("chain.toml", small, kEnd, {});
  EXPECT_GT(gpu.steps_on_device, 0);
  EXPECT_EQ(gpu.counts.steps, host.counts.steps);
  expect_same(gpu, host, 1e-10);
}

// The mass of a rigid body stands in W though nothing declares its diagonal.
TEST(DeviceMotion, TopOnAFlexibleArmGoesAsOnTheHost) {
  constexpr double kEnd = 2e-4;
  const auto build = [] { return built(test::kTopOnAnArm); };
  const RunResult host = run_built(build, kEnd, {.place = Place::host}), gpu = run_built(build, kEnd, {});
  EXPECT_TRUE(gpu.on_device_at_end);
  EXPECT_EQ(gpu.counts.steps, host.counts.steps);
  expect_same(gpu, host, 1e-10);
}

// A factor that bodies have turned with is the host's, and so are the vectors while it serves.
TEST(DeviceMotion, TurnedFactorsAreTheHosts) {
  constexpr double kEnd = 8.3e-5;
  const RunResult host = run_model("engine.toml", kSmallEngine, kEnd, {.place = Place::host});
  const RunResult gpu = run_model("engine.toml", kSmallEngine, kEnd, {});
  EXPECT_GT(gpu.turns, 0);
  EXPECT_LT(gpu.steps_on_device, gpu.counts.steps);
  EXPECT_TRUE(gpu.on_device_at_end);
  expect_same(gpu, host, 1e-7);
}

// The factor is lost in the middle of a step.
TEST(DeviceMotion, TheHostTakesAStepOver) {
  constexpr double kEnd = 1e-6;
  const RunResult host = run_model("engine.toml", kSmallEngine, kEnd, {.place = Place::host});
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
  const RunResult host = run_model("engine.toml", kSmallEngine, kEnd, {.place = Place::host});
  for (const int sends : {0, 3, 9, 14}) {
    SCOPED_TRACE(sends);
    const RunResult gpu = run_model("engine.toml", kSmallEngine, kEnd, {.calls = {.sends = sends}});
    EXPECT_FALSE(gpu.on_device_at_end);
    expect_same(gpu, host, 1e-9);
  }
}

// Steps are as long as errors allow, which are looked at with a tolerance of 1e-5.
TEST(DeviceMotion, TheHostGoesOnWhereverTheGpuFails) {
  test::expect_to_go_on_wherever_it_fails(
      [](const Course& course) { return run_model("engine.toml", kSmallEngine, 1e-6, course); }, Place::emulated, 1e-6);
}

// A run that is saved goes on with the bits of the one that was restored: both begin on the host again.
TEST(DeviceMotion, GoesOnAfterARestart) {
  constexpr double kEnd = 1e-6;
  const RunResult through = run_model("engine.toml", kSmallEngine, kEnd, {}),
                  restored = run_model("engine.toml", kSmallEngine, kEnd, {.save_after = 6}),
                  saved = run_model("engine.toml", kSmallEngine, kEnd, {.save_after = 6, .restores = false});
  EXPECT_TRUE(restored.on_device_at_end);
  expect_same(restored, through, 1e-7);
  EXPECT_EQ(saved.end.q, restored.end.q);
  EXPECT_EQ(saved.end.v, restored.end.v);
  EXPECT_EQ(saved.end.lambda, restored.end.lambda);
}

// As where an event is looked for: the vectors are the copy's from its first step on.
TEST(DeviceMotion, ACopyTakesThemOver) {
  constexpr double kEnd = 1e-6;
  const RunResult host = run_model("engine.toml", kSmallEngine, kEnd, {.place = Place::host}),
                  gpu = run_model("engine.toml", kSmallEngine, kEnd, {.copy_after = 6});
  EXPECT_TRUE(gpu.on_device_at_end);
  expect_same(gpu, host, 1e-6);
}

// Several GPUs share the elements, and give the bits of one.
void expect_the_bits_of_one(const RunResult& several, const RunResult& one) {
  EXPECT_TRUE(several.on_device_at_end);
  EXPECT_EQ(several.counts.newton_iterations, one.counts.newton_iterations);
  EXPECT_EQ(several.end.q, one.end.q);
  EXPECT_EQ(several.end.v, one.end.v);
  EXPECT_EQ(several.end.lambda, one.end.lambda);
}

TEST(DeviceMotion, SeveralGpusGiveTheBitsOfOne) {
  constexpr double kEnd = 1e-6;
  const RunResult one = run_model("engine.toml", kSmallEngine, kEnd, {});
  for (const int gpus : {2, 3, 5}) {
    SCOPED_TRACE(gpus);
    expect_the_bits_of_one(run_model("engine.toml", kSmallEngine, kEnd, {.gpus = gpus}), one);
  }
}

class DeviceMotionOnGpu : public espalier::test::OnGpu {};

TEST_F(DeviceMotionOnGpu, GoesAsOnTheHost) {
  constexpr double kEnd = 3e-6;
  const RunResult host = run_model("engine.toml", kSmallEngine, kEnd, {.place = Place::host}),
                  gpu = run_model("engine.toml", kSmallEngine, kEnd, {.place = Place::gpu}),
                  again = run_model("engine.toml", kSmallEngine, kEnd, {.place = Place::gpu});
  EXPECT_TRUE(gpu.on_device_at_end);
  expect_same(gpu, host, 1e-9);
  EXPECT_EQ(again.end.q, gpu.end.q);
  EXPECT_EQ(again.end.v, gpu.end.v);
}

TEST_F(DeviceMotionOnGpu, PartsGiveTheBitsOfTheWhole) {
  constexpr double kEnd = 3e-6;
  const RunResult one = run_model("engine.toml", kSmallEngine, kEnd, {.place = Place::gpu});
  for (const int gpus : {2, 4}) {
    SCOPED_TRACE(gpus);
    expect_the_bits_of_one(run_model("engine.toml", kSmallEngine, kEnd, {.place = Place::gpu, .gpus = gpus}), one);
  }
}

TEST_F(DeviceMotionOnGpu, TheHostGoesOnWhereverTheGpuFails) {
  test::expect_to_go_on_wherever_it_fails(
      [](const Course& course) { return run_model("engine.toml", kSmallEngine, 1e-6, course); }, Place::gpu, 1e-6);
}

}  // namespace
}  // namespace espalier::dynamics

// The vectors of generalized-alpha on a GPU, most often an emulated one. Truth: the host.
#include <gtest/gtest.h>

#include "dynamics/device/device_run.hpp"
#include "dynamics/integrators/generalized_alpha.hpp"
#include "dynamics/model/built_model.hpp"
#include "solver/gpu/gpu_fixture.hpp"

namespace espalier::dynamics {
namespace {

using test::Course;
using test::expect_same;
using test::kSmallEngine;
using test::Place;
using test::RunResult;

/// @param steps  up to the end, which may be no whole number
RunResult run_alpha(const test::Build& build, double step, double steps, const Course& course) {
  AlphaOptions options;
  options.step = step;
  return test::run_there(build, steps * step, course,
                         [&](Equations& equations) { return GeneralizedAlpha(equations, options); });
}

RunResult run_engine(double steps, const Course& course) {
  return run_alpha([] { return test::built_from("engine.toml", kSmallEngine, 1); }, 1e-6, steps, course);
}

// A rigid piston, joints and a motor on the host; two flexible bodies there. The first step is the host's.
TEST(DeviceAlpha, EngineGoesAsOnTheHost) {
  const RunResult host = run_engine(20, {.place = Place::host}), gpu = run_engine(20, {});
  EXPECT_EQ(host.steps_on_device, 0);
  EXPECT_TRUE(gpu.on_device_at_end);
  EXPECT_EQ(gpu.steps_on_device, gpu.counts.steps - 1);
  EXPECT_EQ(gpu.counts.steps, 20);
  EXPECT_EQ(gpu.counts.newton_iterations, host.counts.newton_iterations);
  expect_same(gpu, host, 1e-10);
  const RunResult again = run_engine(20, {});
  EXPECT_EQ(again.end.q, gpu.end.q);
  EXPECT_EQ(again.end.v, gpu.end.v);
}

// Guides act on faces of its links, and there is gravity.
TEST(DeviceAlpha, ChainGoesAsOnTheHost) {
  const auto build = [] { return test::built_from("chain.toml", {"parameters.unknowns=1500"}, 1); };
  const RunResult host = run_alpha(build, 2e-5, 10, {.place = Place::host}), gpu = run_alpha(build, 2e-5, 10, {});
  EXPECT_GT(gpu.steps_on_device, 0);
  EXPECT_EQ(gpu.counts.steps, host.counts.steps);
  expect_same(gpu, host, 1e-10);
}

// What a body that spins remembers is carried with its axes, by the host.
TEST(DeviceAlpha, TopOnAFlexibleArmGoesAsOnTheHost) {
  const auto build = [] { return built(test::kTopOnAnArm); };
  const RunResult host = run_alpha(build, 1e-4, 50, {.place = Place::host}), gpu = run_alpha(build, 1e-4, 50, {});
  EXPECT_TRUE(gpu.on_device_at_end);
  EXPECT_EQ(gpu.counts.newton_iterations, host.counts.newton_iterations);
  expect_same(gpu, host, 1e-10);
}

// The host takes a step of another length, and the vectors return in the one that follows.
TEST(DeviceAlpha, StepsOfANewLengthAreTheHosts) {
  const RunResult host = run_engine(6.5, {.place = Place::host}), gpu = run_engine(6.5, {});
  EXPECT_EQ(gpu.counts.steps, 7);
  EXPECT_EQ(gpu.steps_on_device, 5);  // not the first one and the first of two shorter ones
  EXPECT_TRUE(gpu.on_device_at_end);
  expect_same(gpu, host, 1e-10);
}

// The factor is lost in the middle of a step.
TEST(DeviceAlpha, TheHostTakesAStepOver) {
  const RunResult host = run_engine(10, {.place = Place::host});
  for (const int after : {0, 1}) {
    SCOPED_TRACE(after);
    const RunResult gpu = run_engine(10, {.fails_after = after});
    expect_same(gpu, host, 1e-9);
  }
}

TEST(DeviceAlpha, TheHostGoesOnWhereverTheGpuFails) {
  test::expect_to_go_on_wherever_it_fails([](const Course& course) { return run_engine(5, course); }, Place::emulated,
                                          1e-9);
}

// A run that is saved goes on with the bits of the one that was restored: both begin on the host again.
TEST(DeviceAlpha, GoesOnAfterARestart) {
  const RunResult through = run_engine(20, {}), restored = run_engine(20, {.save_after = 6}),
                  saved = run_engine(20, {.save_after = 6, .restores = false});
  EXPECT_TRUE(restored.on_device_at_end);
  expect_same(restored, through, 1e-7);
  EXPECT_EQ(saved.end.q, restored.end.q);
  EXPECT_EQ(saved.end.v, restored.end.v);
  EXPECT_EQ(saved.end.lambda, restored.end.lambda);
}

// As where an event is looked for: the vectors are the copy's from its first step on.
TEST(DeviceAlpha, ACopyTakesThemOver) {
  const RunResult host = run_engine(10, {.place = Place::host}), gpu = run_engine(10, {.copy_after = 4});
  EXPECT_TRUE(gpu.on_device_at_end);
  EXPECT_EQ(gpu.counts.steps, 10);
  expect_same(gpu, host, 1e-9);
}

class DeviceAlphaOnGpu : public espalier::test::OnGpu {};

void compare_on_gpu(const test::Build& build, double step, double steps) {
  const RunResult host = run_alpha(build, step, steps, {.place = Place::host}),
                  gpu = run_alpha(build, step, steps, {.place = Place::gpu}),
                  again = run_alpha(build, step, steps, {.place = Place::gpu});
  EXPECT_TRUE(gpu.on_device_at_end);
  EXPECT_GT(gpu.steps_on_device, 0);
  EXPECT_EQ(gpu.counts.steps, host.counts.steps);
  expect_same(gpu, host, 1e-9);
  EXPECT_EQ(again.end.q, gpu.end.q);
  EXPECT_EQ(again.end.v, gpu.end.v);
}

TEST_F(DeviceAlphaOnGpu, EngineGoesAsOnTheHost) {
  compare_on_gpu([] { return test::built_from("engine.toml", kSmallEngine, 2); }, 1e-6, 20);
}

TEST_F(DeviceAlphaOnGpu, ChainGoesAsOnTheHost) {
  compare_on_gpu([] { return test::built_from("chain.toml", {"parameters.unknowns=7000"}, 2); }, 2e-5, 10);
}

TEST_F(DeviceAlphaOnGpu, TopOnAFlexibleArmGoesAsOnTheHost) {
  compare_on_gpu([] { return built(test::kTopOnAnArm); }, 1e-4, 50);
}

TEST_F(DeviceAlphaOnGpu, TheHostGoesOnWhereverTheGpuFails) {
  test::expect_to_go_on_wherever_it_fails([](const Course& course) { return run_engine(5, course); }, Place::gpu, 1e-9);
}

}  // namespace
}  // namespace espalier::dynamics

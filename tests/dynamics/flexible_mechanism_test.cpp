// The flexible slider-crank engine: the constraints hold on all three levels at every step.
#include <filesystem>

#include "dynamics/model_common.hpp"
#include "places.hpp"

namespace espalier::dynamics {
namespace {

TEST(FlexibleEngine, ConstraintsHoldOnAllThreeLevels) {
  const auto models = espalier::test::source_folder() / "models";
  if (!std::filesystem::exists(models / "engine.toml")) GTEST_SKIP() << models << " is not there";
  SimulationOptions options;
  options.set = {"parameters.unknowns=1000"};
  options.until = 0.005;
  Simulation simulation(std::move(options));
  Status status = simulation.load((models / "engine.toml").string());
  if (status.ok()) status = simulation.run();
  ASSERT_TRUE(status.ok()) << status.message;
  // 1e-10 of the positions, and of the largest velocity and acceleration: below 20 m/s and 2e4 m/s^2 until then.
  const auto& levels = simulation.summary().largest_violation;
  EXPECT_LE(levels.position, 1e-10);
  EXPECT_LE(levels.velocity, 2e-9);
  EXPECT_LE(levels.acceleration, 2e-6);
  // The forces of the elements are what costs. Measured in 28 steps: 64 evaluations and 20 factorizations; with every
  // level iterated to its end together with F: 177 and 49.
  const SimulationSummary& summary = simulation.summary();
  ASSERT_GT(summary.steps, 20);
  EXPECT_LE(summary.residuals, 3 * summary.steps);
  EXPECT_LE(summary.factorizations, summary.steps);
}

}  // namespace
}  // namespace espalier::dynamics

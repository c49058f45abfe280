// The flexible slider-crank engine: the constraints hold on all three levels at every step.
#include <filesystem>

#include "dynamics/model_common.hpp"

namespace espalier::dynamics {
namespace {

TEST(FlexibleEngine, ConstraintsHoldOnAllThreeLevels) {
  const auto models = std::filesystem::path(__FILE__).parent_path() / "../../models";
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
}

}  // namespace
}  // namespace espalier::dynamics

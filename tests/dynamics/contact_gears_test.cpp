// models/gears.toml on a coarse mesh.
#include <cmath>
#include <numbers>

#include "model_common.hpp"

namespace espalier::dynamics {
namespace {

// Truth: without friction the force between the flanks acts along the line of action, torque over base radius, and the
// torques stand in the ratio of the teeth. The chords of coarse flanks turn the line of action a little.
TEST(ContactGears, StaticForceIsTorqueOverBaseRadius) {
  constexpr double kTorque = 1.5, kModule = 0.002, kAngle = 20 * std::numbers::pi / 180;
  constexpr int kPinion = 18, kGear = 27;
  SimulationOptions o;
  o.set = {"parameters.friction=0", "parameters.flank=4"};
  o.quantities = {"teeth.moment.z", "teeth.force.x", "teeth.force.y"};
  Simulation s(o);
  const Status status = s.load((espalier::test::source_folder() / "models/gears.toml").string());
  ASSERT_TRUE(status.ok()) << status.message;
  const double base = 0.5 * kModule * kGear * std::cos(kAngle);
  EXPECT_NEAR(s.value("teeth.normal_force") / (kTorque / base), 1, 0.03);
  EXPECT_NEAR(s.value("motor.moment.z") / (kTorque * kPinion / kGear), 1, 0.03);
  EXPECT_NEAR(std::atan2(s.value("teeth.force.x"), s.value("teeth.force.y")), kAngle, 0.05);
  EXPECT_NEAR(s.value("teeth.moment.z") / s.value("motor.moment.z"), 1, 1e-6);
  EXPECT_GT(s.value("teeth.area"), 0);
  EXPECT_EQ(s.value("teeth.friction_force"), 0);
}

}  // namespace
}  // namespace espalier::dynamics

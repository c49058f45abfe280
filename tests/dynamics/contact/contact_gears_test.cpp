// models/gears.toml on a coarse mesh.
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace contact_gears_test {

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

// A tenth of the torque presses the flanks by less than the chords of their fillets overlap: on the way to the load the
// teeth let go of each other, and there is no equilibrium before others catch them. Truth: the torques alone; with one
// or two coarse faces in touch forces are good to some percent.
TEST(ContactGears, StaticsGoOnWhereTeethLetGo) {
  constexpr double kTorque = 0.15;
  for (const auto& [pinion, gear, flank] : {std::array{18, 20, 6}, std::array{20, 40, 3}}) {
    SimulationOptions o;
    o.set = {"parameters.friction=0", "parameters.torque=0.15", "parameters.pinion=" + std::to_string(pinion),
             "parameters.gear=" + std::to_string(gear), "parameters.flank=" + std::to_string(flank)};
    if (flank < 6) o.set.emplace_back("parameters.across=2");
    Simulation s(o);
    const Status status = s.load((espalier::test::source_folder() / "models/gears.toml").string());
    ASSERT_TRUE(status.ok()) << status.message;
    const double arm = 0.001 * gear;  // of the pitch circle
    const double moment = s.value("teeth.moment.z"),
                 about_gear = moment - arm * (1 + 1.0 * pinion / gear) * s.value("teeth.force.y");
    EXPECT_NEAR(std::abs(about_gear), kTorque, 1e-6 * kTorque) << pinion << ' ' << gear;
    EXPECT_NEAR(s.value("motor.moment.z") / (kTorque * pinion / gear), 1, 0.1) << pinion << ' ' << gear;
  }
}

// Truth: over a whole pitch the gear turns by the ratio of the teeth and the motor does the work of the brake, wherever
// the pitch begins. In between, teeth that bend make the gear lag and lead by some micrometres on the line of action.
TEST(ContactGears, WholePitchesTurnInTheRatioOfTheTeeth) {
  constexpr double kTorque = 1.5, kRatio = 18.0 / 27, kPitch = 2 * std::numbers::pi / 18, kBegin = 2.4e-3;
  SimulationOptions o;
  o.set = {"parameters.friction=0",  "parameters.flank=3",        "parameters.across=2",
           "parameters.relief=2e-5", "output.vtu_interval=false", "output.csv_interval=false"};
  o.until = 8.5e-3;
  Simulation s(o);
  Status status = s.load((espalier::test::source_folder() / "models/gears.toml").string());
  std::vector<std::array<double, 3>> steps;  // angle of the pinion, of the gear, work of the motor
  double work = 0, before = 0;
  if (status.ok())
    status = s.run([&](const SimulationStep& step) {
      const double angle = s.value("motor.angle");
      work += s.value("motor.moment.z") * (angle - before);
      before = angle;
      if (step.t > kBegin) steps.push_back({angle, s.value("gear_bearing.angle"), work});
      return true;
    });
  ASSERT_TRUE(status.ok()) << status.message;
  double largest_lag = 0;
  int pitches = 0;
  const double base = 0.5 * 0.002 * 27 * std::cos(20 * std::numbers::pi / 180);
  for (std::size_t k = 1; k < steps.size(); ++k) {
    const auto& [angle, gear, done] = steps[k];
    const double lag = gear - steps[0][1] + kRatio * (angle - steps[0][0]);
    largest_lag = std::max(largest_lag, base * std::abs(lag));
    const double over = angle - steps[0][0] - kPitch, last = steps[k - 1][0] - steps[0][0] - kPitch;
    if (!(last < 0 && over >= 0)) continue;
    const double share = over / (over - last);  // back to the whole pitch
    EXPECT_NEAR((gear - share * (gear - steps[k - 1][1]) - steps[0][1]) / (-kRatio * kPitch), 1, 1e-3);
    EXPECT_NEAR((done - share * (done - steps[k - 1][2]) - steps[0][2]) / (kTorque * kRatio * kPitch), 1, 0.015);
    ++pitches;
  }
  EXPECT_EQ(pitches, 1);
  EXPECT_GT(largest_lag, 5e-6);
  EXPECT_LT(largest_lag, 40e-6);
}

}  // namespace contact_gears_test
}  // namespace espalier::dynamics

// Reactions of bodies that turn on and on about an axis. Truth: Euler's equations about it.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "dynamics/dae/frame.hpp"
#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace fixed_axis_reactions_test {

// Multipliers are predicted from step to step; where Newton's iteration looks at q and v alone, their errors grow while
// places and speeds stay right.
void check_fixed_axis(const std::string& settings) {
  const Vec3 axis = Vec3(0.1, 0.2, 1).normalized(), load(3, 5, 0);
  const double torque = -7.7;
  const Simulation s = simulated(fmt::format(
      "[bodies.table]\ntype = \"rigid\"\nmass = 20\nbox = [0.4, 0.4, 0.05]\n[joints.pin]\ntype = \"revolute\"\n"
      "bodies = [\"ground\", \"table\"]\nat = [0, 0, 0]\naxis = [0.1, 0.2, 1]\n[forces.motor]\ntype = "
      "\"torque-motor\"\n"
      "bodies = [\"ground\", \"table\"]\nat = [0, 0, 0]\naxis = [0.1, 0.2, 1]\ntorque = {}\n[forces.side]\ntype = "
      "\"load\"\na = {{ body = \"table\" }}\nmoment = [3, 5, 0]\n[integrator]\nend = 2\n{}",
      torque, settings));
  const double angle = s.value("pin.angle"), speed = s.value("pin.angular_speed");
  const Mat3 turned = Eigen::AngleAxisd(angle, axis).toRotationMatrix();
  const Vec3 principal = 20.0 / 12 * Vec3(0.1625, 0.1625, 0.32);  // of the box
  const Mat3 inertia = turned * principal.asDiagonal() * turned.transpose();
  const double alpha = (torque + axis.dot(load)) / axis.dot(inertia * axis);
  EXPECT_NEAR(speed, 2 * alpha, 1e-4 * std::abs(alpha));
  const Vec3 moment = alpha * (inertia * axis) + speed * speed * axis.cross(inertia * axis) - torque * axis - load;
  for (int k = 0; k < 3; ++k)
    EXPECT_NEAR(s.value(fmt::format("pin.moment.{}", "xyz"[k])), moment[k], 5e-3 * moment.norm()) << settings;
}

TEST(FixedAxisReactions, OfSettingsByDefault) { check_fixed_axis(""); }

TEST(FixedAxisReactions, OfEveryTolerance) {
  for (const char* relative : {"1e-5", "1e-6", "1e-7", "1e-8", "1e-9"})
    check_fixed_axis(std::string("relative = ") + relative);
}

}  // namespace fixed_axis_reactions_test
}  // namespace espalier::dynamics

#include "dynamics/joints/rows.hpp"

namespace espalier::dynamics {

// The turn from A to B, as a quaternion (w, v) in the axes of A, has no part about z: x_A . y_B - y_A . x_B = -4 w v_z.
// Then the relative angular velocity has no part along z_A + z_B, and shafts along z turn at one speed.
std::unique_ptr<Joint> constant_velocity_joint(std::string name, FramePtr a, FramePtr b) {
  using namespace joint_rows;
  std::vector<JointRow> rows;
  add_coincidence(rows);
  JointRow turn = row("rotation about the shafts", {Relative::dot, 0, 1});
  turn.terms.push_back({Relative::dot, 1, 0, 0, 1, -1.0});
  rows.push_back(std::move(turn));
  auto joint = make("constant velocity", std::move(name), std::move(a), std::move(b), std::move(rows));
  joint->add_motion({"bend_angle", "bend_speed", {Relative::bend}});
  return joint;
}

}  // namespace espalier::dynamics

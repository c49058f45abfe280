#include "dynamics/joints/rows.hpp"

namespace espalier::dynamics {

std::unique_ptr<Joint> in_plane_joint(std::string name, FramePtr a, FramePtr b) {
  using namespace joint_rows;
  auto joint =
      make("in plane", std::move(name), std::move(a), std::move(b), {row("translation along z", {Relative::along, 2})});
  joint->add_motion({"displacement_x", "speed_x", {Relative::along, 0}});
  joint->add_motion({"displacement_y", "speed_y", {Relative::along, 1}});
  return joint;
}

}  // namespace espalier::dynamics

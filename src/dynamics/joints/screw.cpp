#include <numbers>

#include "dynamics/joints/rows.hpp"

namespace espalier::dynamics {

std::unique_ptr<Joint> screw_joint(std::string name, FramePtr a, FramePtr b, double lead) {
  using namespace joint_rows;
  std::vector<JointRow> rows = {row("translation along x", {Relative::along, 0}),
                                row("translation along y", {Relative::along, 1})};
  add_parallel(rows);
  rows.push_back(coupling({{Relative::along, 2}, {Relative::angle, 0, 0, 0, 1, -lead / (2 * std::numbers::pi)}}));
  rows.back().label = "thread";
  auto joint = counted(make("screw", std::move(name), std::move(a), std::move(b), std::move(rows)));
  joint->add_motion({"displacement", "speed", {Relative::along, 2}});
  return joint;
}

}  // namespace espalier::dynamics

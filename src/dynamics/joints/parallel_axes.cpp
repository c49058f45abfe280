#include "dynamics/joints/rows.hpp"

namespace espalier::dynamics {

std::unique_ptr<Joint> parallel_axes_joint(std::string name, FramePtr a, FramePtr b) {
  using namespace joint_rows;
  std::vector<JointRow> rows;
  add_parallel(rows);
  return counted(make("parallel axes", std::move(name), std::move(a), std::move(b), std::move(rows)));
}

}  // namespace espalier::dynamics

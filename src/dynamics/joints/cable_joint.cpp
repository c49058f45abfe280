#include <stdexcept>

#include "dynamics/joints/rows.hpp"

namespace espalier::dynamics {

std::unique_ptr<Joint> cable_joint(std::string name, std::vector<FramePtr> frames, double length) {
  if (!(length > 0)) throw std::invalid_argument("cable \"" + name + "\": the length must be positive");
  JointRow sum;
  sum.label = "length";
  sum.offset = length;
  for (int k = 0; k + 1 < static_cast<int>(frames.size()); ++k)
    sum.terms.push_back({Relative::distance, 0, 0, k, k + 1});
  auto joint = std::make_unique<Joint>("cable", std::move(name), std::move(frames), std::vector<JointRow>{sum});
  joint->name_row_force("tension", 0);
  return joint;
}

}  // namespace espalier::dynamics

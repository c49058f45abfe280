#include "dynamics/joints/coupled_slides.hpp"

#include <utility>

namespace espalier::dynamics {

std::unique_ptr<Joint> coupled_slides(std::string name, FramePtr a, FramePtr b, FramePtr c, FramePtr d, double ratio) {
  JointRow row;
  row.label = "coupling";
  row.terms = {{Relative::along, 2, 0, 0, 1, ratio}, {Relative::along, 2, 0, 2, 3, 1.0}};
  row.measure_offset = true;
  std::vector<FramePtr> frames;
  for (FramePtr* f : {&a, &b, &c, &d}) frames.push_back(std::move(*f));
  return std::make_unique<Joint>("coupled slides", std::move(name), std::move(frames), std::vector<JointRow>{row});
}

}  // namespace espalier::dynamics

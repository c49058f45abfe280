#include <array>

#include "dynamics/model/joint_kinds/kind.hpp"

namespace espalier::dynamics::model {

JointStart start_of(const std::vector<MarkerSpec>& markers, const FrameBuilder& frames,
                    std::function<TimeFunction(double)> motion) {
  JointStart start;
  for (const MarkerSpec& marker : markers) start.frames.push_back(frames.initial_motion(marker));
  start.motion = std::move(motion);
  return start;
}

const JointKind* joint_kind(JointType type) {
  static const std::array<const JointKind*, 11> kRows = {
      &kScrew,          &kConstantVelocity, &kParallelAxes, &kInPlane, &kInLine, &kPointOnCurve,
      &kPointOnSurface, &kGearPair,         &kRackPair,     &kWorm,    &kCable};
  for (const JointKind* row : kRows)
    if (row->type == type) return row;
  return nullptr;
}

}  // namespace espalier::dynamics::model

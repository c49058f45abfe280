#include <fmt/format.h>
#include <fmt/ranges.h>

#include <stdexcept>

#include "dynamics/joints/relative.hpp"
#include "dynamics/model/joint_kinds/kind.hpp"

namespace espalier::dynamics::model {

const JointKind& joint_kind(JointType type) {
  for (const JointKind* row : kJointKinds)
    if (row->type == type) return *row;
  throw std::logic_error("a type of joint has no row");
}

std::string joints_that(bool (*have)(const JointKind& kind)) {
  std::vector<std::string> names;
  for (const JointKind* row : kJointKinds)
    if (have(*row)) names.emplace_back(row->name);
  const std::string last = names.back();
  names.pop_back();
  return names.empty() ? last : fmt::format("{} and {}", fmt::join(names, ", "), last);
}

double measure(Relative kind, int axis, const FrameMotion& a, const FrameMotion& b) {
  RelativeValue value;
  evaluate(kind, axis, 0, a, b, false, value);
  return value.value;
}

JointStart start_of(const std::vector<MarkerSpec>& markers, const FrameBuilder& frames,
                    std::function<TimeFunction(double)> motion) {
  JointStart start;
  for (const MarkerSpec& marker : markers) start.frames.push_back(frames.initial_motion(marker));
  start.motion = std::move(motion);
  return start;
}

}  // namespace espalier::dynamics::model

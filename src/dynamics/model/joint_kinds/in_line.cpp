#include "dynamics/model/joint_kinds/kind.hpp"

namespace espalier::dynamics::model {
namespace {

std::unique_ptr<Joint> make_in_line(const JointSpec& j, std::vector<FramePtr> f, const JointStart& /*start*/) {
  return point_on_line(j.name, std::move(f[0]), std::move(f[1]));
}

}  // namespace

/// The same as point-on-line, by the name that other programs give it.
const JointKind kInLine = {.type = JointType::in_line,
                           .name = "in-line",
                           .make = make_in_line,
                           .axes = JointKind::Axes::one,
                           .turns_b = false,
                           .freedom = {.slides = true, .limits = true},
                           .hold = {.any = true, .x = true, .y = true, .z = false, .turn = JointHold::Turn::free}};

}  // namespace espalier::dynamics::model

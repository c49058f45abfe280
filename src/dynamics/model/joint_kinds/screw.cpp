#include "dynamics/model/joint_kinds/kind.hpp"

namespace espalier::dynamics::model {
namespace {

void read_screw(Section& s, JointSpec& j, Description& /*model*/) {
  j.parameter = s.number("lead");
  if (j.parameter == 0) fail(s.place("lead"), "must not be 0; a joint that turns without moving on is a revolute one");
}

std::unique_ptr<Joint> make_screw(const JointSpec& j, std::vector<FramePtr> f, const JointStart& /*start*/) {
  return screw_joint(j.name, std::move(f[0]), std::move(f[1]), j.parameter);
}

}  // namespace

const JointKind kScrew = {.type = JointType::screw,
                          .name = "screw",
                          .read = read_screw,
                          .make = make_screw,
                          .axes = JointKind::Axes::one,
                          .couples = true,
                          .freedom = {.turns = true, .slides = true, .limits = true, .moments = true},
                          .hold = {.any = true, .x = true, .y = true, .z = false, .turn = JointHold::Turn::axis}};

}  // namespace espalier::dynamics::model

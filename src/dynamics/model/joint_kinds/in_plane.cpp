#include "dynamics/model/joint_kinds/kind.hpp"

namespace espalier::dynamics::model {
namespace {

std::unique_ptr<Joint> make_in_plane(const JointSpec& j, std::vector<FramePtr> f, const JointStart& /*start*/) {
  return in_plane_joint(j.name, std::move(f[0]), std::move(f[1]));
}

}  // namespace

const JointKind kInPlane = {.type = JointType::in_plane,
                            .name = "in-plane",
                            .make = make_in_plane,
                            .axes = JointKind::Axes::one,
                            .turns_b = false,
                            .freedom = {.surface = true},
                            .hold = {.any = true, .x = false, .y = false, .z = true, .turn = JointHold::Turn::free}};

}  // namespace espalier::dynamics::model

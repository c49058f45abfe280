#include "dynamics/model/joint_kinds/kind.hpp"

namespace espalier::dynamics::model {
namespace {

std::unique_ptr<Joint> make_parallel_axes(const JointSpec& j, std::vector<FramePtr> f, const JointStart& /*start*/) {
  return parallel_axes_joint(j.name, std::move(f[0]), std::move(f[1]));
}

}  // namespace

const JointKind kParallelAxes = {
    .type = JointType::parallel_axes,
    .name = "parallel-axes",
    .make = make_parallel_axes,
    .axes = JointKind::Axes::one,
    .freedom = {.turns = true, .limits = true, .moments = true},
    .hold = {.any = true, .x = false, .y = false, .z = false, .turn = JointHold::Turn::axis}};

}  // namespace espalier::dynamics::model

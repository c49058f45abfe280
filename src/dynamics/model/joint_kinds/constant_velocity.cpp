#include "dynamics/model/joint_kinds/kind.hpp"

namespace espalier::dynamics::model {
namespace {

std::unique_ptr<Joint> make_constant_velocity(const JointSpec& j, std::vector<FramePtr> f,
                                              const JointStart& /*start*/) {
  return constant_velocity_joint(j.name, std::move(f[0]), std::move(f[1]));
}

/// Shafts may be put together at any turn: frame b is turned about its shaft, not its body.
void take_up_turn(JointSpec& j, const FrameBuilder& frames) {
  for (const MarkerSpec& m : j.frames)
    if (!frames.make(m)->has_rotation()) return;  // the joint says what it needs
  const Mat3 a = frames.initial_motion(j.frames[0]).rot, b = frames.initial_motion(j.frames[1]).rot;
  constexpr double kBack = -0.999;  // shafts that point against each other
  if (a.col(2).dot(b.col(2)) < kBack)
    fail(j.place,
         "the shafts of a constant-velocity joint point against each other: their axes (z of a and b) go on in one "
         "direction; turn 'axis' of one of them round");
  const Eigen::Quaterniond turn(Mat3(a.transpose() * b));
  const double twist = 2 * std::atan2(turn.z(), turn.w());
  constexpr double kNone = 1e-15;
  if (std::abs(twist) <= kNone) return;
  j.frames[1].axes = j.frames[1].axes * Eigen::AngleAxisd(-twist, Vec3::UnitZ()).toRotationMatrix();
}

}  // namespace

const JointKind kConstantVelocity = {
    .type = JointType::constant_velocity,
    .name = "constant-velocity",
    .make = make_constant_velocity,
    .axes = JointKind::Axes::one,
    .freedom = {.limits = true},
    .hold = {.any = true, .x = true, .y = true, .z = true, .turn = JointHold::Turn::free},
    .complete = take_up_turn};

}  // namespace espalier::dynamics::model

// Joints that lead a coordinate.
#include "dynamics/joints/relative.hpp"
#include "dynamics/model/joint_kinds/kind.hpp"

namespace espalier::dynamics::model {
namespace {

void read_joint_motion(Section& s, JointSpec& j, Description& /*model*/) {
  j.function = s.function("motion");
  j.relative = s.choice("from", {"zero", "initial"}, 0) == 1;
}

void read_prescribed(Section& s, JointSpec& j, Description& model) {
  j.axis = s.choice("direction", {"x", "y", "z"});
  read_joint_motion(s, j, model);
}

TimeFunction motion_of(const JointSpec& j, const JointStart& start, Relative kind, int axis) {
  return start.motion(j.relative ? measure(kind, axis, start.frames[0], start.frames[1]) : 0);
}

std::unique_ptr<Joint> make_rotation_motor(const JointSpec& j, std::vector<FramePtr> f, const JointStart& start) {
  return rotation_motor(j.name, std::move(f[0]), std::move(f[1]), motion_of(j, start, Relative::angle, 0));
}

std::unique_ptr<Joint> make_translation_motor(const JointSpec& j, std::vector<FramePtr> f, const JointStart& start) {
  return translation_motor(j.name, std::move(f[0]), std::move(f[1]), motion_of(j, start, Relative::along, 2));
}

std::unique_ptr<Joint> make_prescribed(const JointSpec& j, std::vector<FramePtr> f, const JointStart& start) {
  return prescribed_coordinate(j.name, std::move(f[0]), std::move(f[1]), j.axis,
                               motion_of(j, start, Relative::global, j.axis));
}

}  // namespace

const JointKind kRotationMotor = {.type = JointType::rotation_motor,
                                  .name = "rotation-motor",
                                  .read = read_joint_motion,
                                  .make = make_rotation_motor,
                                  .axes = JointKind::Axes::one,
                                  .starts = false};

const JointKind kTranslationMotor = {.type = JointType::translation_motor,
                                     .name = "translation-motor",
                                     .read = read_joint_motion,
                                     .make = make_translation_motor,
                                     .axes = JointKind::Axes::one,
                                     .starts = false};

const JointKind kPrescribed = {.type = JointType::prescribed,
                               .name = "prescribed",
                               .read = read_prescribed,
                               .make = make_prescribed,
                               .turns_a = false,
                               .turns_b = false,
                               .starts = false};

}  // namespace espalier::dynamics::model

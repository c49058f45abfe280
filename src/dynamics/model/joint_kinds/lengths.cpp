// Joints that hold a distance.
#include "dynamics/joints/relative.hpp"
#include "dynamics/model/joint_kinds/kind.hpp"

namespace espalier::dynamics::model {
namespace {

void read_distance(Section& s, JointSpec& j, Description& /*model*/) {
  j.parameter = read_measure(s, "length", j.measured);
  if (!j.measured && !(j.parameter > 0))
    fail(s.place("length"), "must be greater than 0; for 0 take a spherical joint");
}

double length_of(const JointSpec& j, const JointStart& start) {
  return j.measured ? measure(Relative::distance, 0, start.frames[0], start.frames[1]) : j.parameter;
}

std::unique_ptr<Joint> make_distance(const JointSpec& j, std::vector<FramePtr> f, const JointStart& start) {
  return distance_joint(j.name, std::move(f[0]), std::move(f[1]), length_of(j, start));
}

std::unique_ptr<Joint> make_revolute_spherical(const JointSpec& j, std::vector<FramePtr> f, const JointStart& start) {
  return revolute_spherical_joint(j.name, std::move(f[0]), std::move(f[1]), length_of(j, start));
}

}  // namespace

const JointKind kDistance = {.type = JointType::distance,
                             .name = "distance",
                             .read = read_distance,
                             .make = make_distance,
                             .turns_a = false,
                             .turns_b = false,
                             .starts = false};

const JointKind kRevoluteSpherical = {.type = JointType::revolute_spherical,
                                      .name = "revolute-spherical",
                                      .read = read_distance,
                                      .make = make_revolute_spherical,
                                      .axes = JointKind::Axes::one,
                                      .turns_b = false,
                                      .starts = false};

}  // namespace espalier::dynamics::model

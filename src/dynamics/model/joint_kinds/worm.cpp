#include <fmt/format.h>

#include "dynamics/model/joint_kinds/wheels.hpp"

namespace espalier::dynamics::model {
namespace {

void read_worm(Section& s, JointSpec& j, Description& /*model*/) {
  j.parameter = s.number("lead");
  if (j.parameter == 0) fail(s.place("lead"), "must not be 0");
  j.radius = s.positive("radius");
}

}  // namespace

WormShape worm_shape(const JointSpec& j, const JointStart& start) {
  const double distance = distance_to_line(start);
  WormShape shape{j.parameter, distance < 0 ? -j.radius : j.radius, std::abs(distance) - j.radius};
  if (!(shape.worm_radius > 0))
    throw std::invalid_argument(
        fmt::format("the pitch radius of the wheel, {:g}, must be less than the distance of its centre (origin of b) "
                    "from the axis of the worm (z of a), {:g}: the rest is the pitch radius of the worm",
                    j.radius, std::abs(distance)));
  return shape;
}

namespace {

std::unique_ptr<Joint> make_worm(const JointSpec& j, std::vector<FramePtr> f, const JointStart& start) {
  return worm_joint(j.name, std::move(f[0]), std::move(f[1]), worm_shape(j, start));
}

}  // namespace

const JointKind kWorm = {.type = JointType::worm,
                         .name = "worm",
                         .read = read_worm,
                         .make = make_worm,
                         .axes = JointKind::Axes::both,
                         .couples = true,
                         .freedom = {.slides = true},
                         .complete = check_crossing};

}  // namespace espalier::dynamics::model

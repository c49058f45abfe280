#include "dynamics/model/joint_kinds/wheels.hpp"

namespace espalier::dynamics::model {

void check_crossing(JointSpec& j, const FrameBuilder& frames) {
  for (const MarkerSpec& m : j.frames)
    if (!frames.make(m)->has_rotation()) return;  // the joint says what it needs
  const Vec3 a = frames.initial_motion(j.frames[0]).rot.col(2), b = frames.initial_motion(j.frames[1]).rot.col(2);
  constexpr double kSquare = 1e-4;
  if (std::abs(a.dot(b)) > kSquare)
    fail(j.place, j.type == JointType::worm
                      ? "the axes of worm and wheel (z of a and b) must cross at a right angle"
                      : "the rack (along z of a) must be perpendicular to the axis of the pinion (z of b)");
}

double distance_to_line(const JointStart& start) {
  const FrameMotion &a = start.frames[0], &b = start.frames[1];
  return a.rot.col(2).cross(b.rot.col(2)).dot(a.r - b.r);
}

namespace {

void read_rack_pair(Section& s, JointSpec& j, Description& /*model*/) {
  j.parameter = read_measure(s, "radius", j.measured);
  if (!j.measured && !(j.parameter > 0)) fail(s.place("radius"), "must be greater than 0");
  j.pressure_angle = checked_pressure_angle(s.number("pressure_angle", 0), s.place("pressure_angle"));
}

std::unique_ptr<Joint> make_rack_pair(const JointSpec& j, std::vector<FramePtr> f, const JointStart& start) {
  const double distance = distance_to_line(start);
  if (distance == 0)
    throw std::invalid_argument(
        "the rack goes through the centre of the pinion: frame 'a' stands on the pitch line of the rack, beside it");
  const double radius = j.measured ? std::abs(distance) : j.parameter;
  return rack_pair(j.name, std::move(f[0]), std::move(f[1]), distance < 0 ? -radius : radius);
}

}  // namespace

const JointKind kRackPair = {.type = JointType::rack_pair,
                             .name = "rack-pair",
                             .read = read_rack_pair,
                             .make = make_rack_pair,
                             .axes = JointKind::Axes::both,
                             .couples = true,
                             .freedom = {.slides = true},
                             .complete = check_crossing};

}  // namespace espalier::dynamics::model

#include <fmt/format.h>

#include <numbers>

#include "dynamics/model/joint_kinds/wheels.hpp"

namespace espalier::dynamics::model {
namespace {

void read_gear_pair(Section& s, JointSpec& j, Description& /*model*/) {
  const std::vector<double> teeth = s.numbers("teeth");
  if (teeth.size() != 2 || !(teeth[0] > 0) || !(teeth[1] > 0))
    fail(s.place("teeth"), "must be two numbers greater than 0: the teeth of wheel a and of wheel b");
  j.teeth = {teeth[0], teeth[1]};
  j.inner = s.choice("inner", {"none", "a", "b"}, 0) - 1;
  if (j.inner >= 0 && !(j.teeth[at(j.inner)] > j.teeth[at(1 - j.inner)]))
    fail(s.place("inner"), "the wheel with inner teeth must have more of them than the one inside it");
  j.pressure_angle = checked_pressure_angle(s.number("pressure_angle", 0), s.place("pressure_angle"));
}

void check_gear_pair(JointSpec& j, const FrameBuilder& frames) {
  for (const MarkerSpec& m : j.frames)
    if (!frames.make(m)->has_rotation()) return;  // the joint says what it needs
  const FrameMotion a = frames.initial_motion(j.frames[0]), b = frames.initial_motion(j.frames[1]);
  constexpr double kParallel = 1e-4;
  if (a.rot.col(2).cross(b.rot.col(2)).norm() > kParallel)
    fail(j.place,
         "the axes of a gear-pair (z of a and b) must be parallel; for axes that cross take a worm, or a gear with "
         "frames on the carrier of both wheels");
}

// Radii from the distance of the centres: the multiplier is then the force at the teeth.
std::array<double, 2> pitch_radii(const JointSpec& j, const JointStart& start) {
  const FrameMotion &a = start.frames[0], &b = start.frames[1];
  const Vec3 axis = a.rot.col(2), d = b.r - a.r;
  const double distance = (d - d.dot(axis) * axis).norm();
  if (!(distance > 0))
    throw std::invalid_argument(
        "the centres of both wheels (origins of a and b) are on one axis; give each wheel's frame its own 'point'");
  std::array<double, 2> radii = j.teeth;
  if (j.inner >= 0) radii[at(j.inner)] *= -1;
  const double scale = distance / std::abs(radii[0] + radii[1]), side = axis.dot(b.rot.col(2)) < 0 ? -1 : 1;
  return {scale * radii[0], side * scale * radii[1]};
}

std::unique_ptr<Joint> make_gear_pair(const JointSpec& j, std::vector<FramePtr> f, const JointStart& start) {
  const std::array<double, 2> radii = pitch_radii(j, start);
  return gear_pair(j.name, std::move(f[0]), std::move(f[1]), radii[0], radii[1]);
}

}  // namespace

double checked_pressure_angle(double angle, const Place& place) {
  if (!(angle >= 0 && angle < std::numbers::pi / 2))
    fail(place, "must lie between 0 and a right angle; involute teeth mostly have 20 degrees");
  return angle;
}

// Each wheel with outer teeth is pressed away from the pitch point: two of them apart, one inside another one towards
// the centre of that.
Separation separation_of(const JointSpec& j, const JointStart& start) {
  if (j.type == JointType::gear_pair) return {{.function = centre_distance()}, j.inner < 0 ? 1.0 : -1.0};
  const FrameMotion &a = start.frames[0], &b = start.frames[1];
  const Vec3 away = a.rot.col(2).cross(b.rot.col(2)) * (distance_to_line(start) < 0 ? 1 : -1);
  return {{.function = distance_along(a.rot.transpose() * away.normalized())}, 1};
}

PairCoordinate pitch_line(const JointSpec& j, const JointStart& start) {
  if (j.type == JointType::rack_pair) return {Relative::along, 2};
  return {.function =
              std::make_shared<PairSum>(std::vector<PairSum::Term>{{pitch_radii(j, start)[0], {Relative::polar}}})};
}

const JointKind kGearPair = {.type = JointType::gear_pair,
                             .name = "gear-pair",
                             .read = read_gear_pair,
                             .make = make_gear_pair,
                             .axes = JointKind::Axes::one,
                             .couples = true,
                             .freedom = {.slides = true},
                             .complete = check_gear_pair};

}  // namespace espalier::dynamics::model

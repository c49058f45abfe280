// What rolls or glides on a plane.
#include "dynamics/model/joint_kinds/kind.hpp"

namespace espalier::dynamics::model {
namespace {

void read_rolling(Section& s, JointSpec& j, Description& /*model*/) {
  RollingShape& shape = j.rolling;
  const bool ball = s.choice("shape", {"wheel", "ball"}, 0) == 1;
  (ball ? shape.rim : shape.radius) = s.positive("radius");
  if (ball && s.has("rim")) fail(s.place("rim"), "a ball has no rim; its radius says all");
  if (!ball && s.has("rim")) {
    shape.rim = s.positive("rim");
    shape.radius -= shape.rim;
    if (!(shape.radius > 0))
      fail(s.place("rim"),
           "must be less than 'radius', which reaches to the outside of the tyre; take shape = \"ball\"");
  }
}

void read_skate(Section& /*s*/, JointSpec& j, Description& /*model*/) { j.rolling.edge = true; }

/// Plane and wheel have axes of their own, which neither can take from the other.
void check_rolling(JointSpec& j, const FrameBuilder& /*frames*/) {
  const bool skate = j.type == JointType::skate, wheel = !skate && j.rolling.directed();
  if (!j.frames[0].axis_given)
    throw std::invalid_argument(
        "needs the plane: give axis = [x, y, z] in frame 'a', the normal towards what rolls (\"rolling\") or glides "
        "(\"skate\") on it");
  if (wheel && !j.frames[1].axis_given)
    throw std::invalid_argument(
        "needs the wheel's axle: give axis = [x, y, z] in frame 'b' (a ball: shape = \"ball\")");
  if (skate && !j.frames[1].axis_given)
    throw std::invalid_argument(
        "needs the direction of the edge: give axis and x_axis = [x, y, z] in frame 'b'; it glides along x_axis");
}

std::unique_ptr<Joint> make_rolling(const JointSpec& j, std::vector<FramePtr> f, const JointStart& /*start*/) {
  return rolling_joint(j.name, std::move(f[0]), std::move(f[1]), j.rolling);
}

}  // namespace

const JointKind kRolling = {.type = JointType::rolling,
                            .name = "rolling",
                            .read = read_rolling,
                            .make = make_rolling,
                            .starts = false,
                            .complete = check_rolling};

const JointKind kSkate = {.type = JointType::skate,
                          .name = "skate",
                          .read = read_skate,
                          .make = make_rolling,
                          .starts = false,
                          .complete = check_rolling};

}  // namespace espalier::dynamics::model

#include <fmt/format.h>

#include "dynamics/joints/space_curve.hpp"
#include "dynamics/mesh/text_file.hpp"
#include "dynamics/model/joint_kinds/kind.hpp"
#include "dynamics/model/joint_kinds/point_file.hpp"

namespace espalier::dynamics::model {
namespace {

void read_point_on_curve(Section& s, JointSpec& j, Description& model) {
  if (s.has("file") == s.has("points")) fail(s.place(), "needs either 'points' or 'file', the points of the curve");
  std::vector<Vec3> points;
  if (s.has("file")) {
    const std::string file = s.text("file");
    const double scale = s.positive("scale", 1);
    points = read_point_file(file.starts_with('/') || model.folder.empty() ? file : model.folder + "/" + file);
    for (Vec3& x : points) x *= scale;
    model.keys.emplace_back(fmt::format("joints.{}.file (its content)", j.name), points_digest(points));
  } else {
    points = s.vectors("points");
  }
  const bool closed = s.flag("closed", false);
  const Place& place = s.has("file") ? s.place("file") : s.place("points");
  at_place(place, [&] { j.curve = std::make_shared<const SpaceCurve>(std::move(points), closed); });
  const bool straight = s.choice("ends", {"limits", "straight"}, 0) == 1;
  if (closed && s.has("ends")) fail(s.place("ends"), "a closed curve has no ends");
  if (!closed && !straight && !s.has("limits"))
    fail(
        s.place(),
        "an open curve has ends: say what happens there. limits = { stiffness = ..., smoothing = ... } stops the point "
        "at them (or at lower and upper along the curve); ends = \"straight\" lets it go on along their tangents, "
        "where "
        "an event that switches the joint off may let it leave");
  if (s.has("motion")) {
    j.function = s.function("motion");
    j.relative = s.choice("from", {"zero", "initial"}, 0) == 1;
  } else if (s.has("from")) {
    fail(s.place("from"), "belongs to 'motion'");
  }
}

std::unique_ptr<Joint> make_point_on_curve(const JointSpec& j, std::vector<FramePtr> f, const JointStart& start) {
  std::optional<TimeFunction> motion;
  if (j.function) {
    const FrameMotion &a = start.frames[0], &b = start.frames[1];
    motion = start.motion(j.curve->arc(j.curve->nearest(a.rot.transpose() * (b.r - a.r))));
  }
  return point_on_curve(j.name, std::move(f[0]), std::move(f[1]), j.curve, std::move(motion));
}

}  // namespace

const JointKind kPointOnCurve = {.type = JointType::point_on_curve,
                                 .name = "point-on-curve",
                                 .read = read_point_on_curve,
                                 .make = make_point_on_curve,
                                 .turns_b = false,
                                 .freedom = {.slides = true, .limits = true, .whole_force = true}};

}  // namespace espalier::dynamics::model

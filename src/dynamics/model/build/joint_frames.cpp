#include "dynamics/model/build/joint_frames.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <utility>

#include "dynamics/bodies/carried_frame.hpp"
#include "dynamics/model/force_kinds/kind.hpp"
#include "dynamics/model/joint_kinds/kind.hpp"

namespace espalier::dynamics::model {
namespace {

using Pair = std::pair<std::size_t, std::size_t>;

/// Pairs of frames of which at least one must say where its axis points.
std::vector<Pair> axes_of(JointType type) {
  const JointKind& kind = joint_kind(type);
  if (kind.axes != JointKind::Axes::one) return {};
  return kind.frames == JointKind::Frames::four ? std::vector<Pair>{{0, 1}, {2, 3}} : std::vector<Pair>{{0, 1}};
}

std::vector<Pair> axes_of(ForceType type) {
  return force_kind(type).has_axis ? std::vector<Pair>{{0, 1}} : std::vector<Pair>{};
}

/// The axes of one marker for another, in the initial state.
void take_axes(const MarkerSpec& from, MarkerSpec& to, const FrameBuilder& frames) {
  constexpr double kSame = 1e-9;
  if (!frames.make(to)->has_rotation() || !frames.make(from)->has_rotation()) return;
  const Mat3 given = frames.initial_motion(from).rot, own = frames.initial_motion(to).rot;
  if (given.col(2).cross(own.col(2)).norm() <= kSame) return;
  to.axes = to.global ? given : Mat3(to.axes * own.transpose() * given);
}

template <class Spec>
void complete_axes(Spec& spec, const std::string& type, const FrameBuilder& frames) {
  for (const auto& [i, j] : axes_of(spec.type)) {
    MarkerSpec &a = spec.frames[i], &b = spec.frames[j];
    if (!a.axis_given && !b.axis_given)
      throw std::invalid_argument(
          fmt::format("'{}' needs an axis, which neither of its frames says: give axis = [x, y, z] in frame '{}' (or "
                      "beside bodies and at), the direction of its z axis",
                      type, "abcd"[i]));
    if (!b.axis_given) take_axes(a, b, frames);
    if (!a.axis_given) take_axes(b, a, frames);
  }
}

/// Several nodes of a flexible body.
bool is_set(const MarkerSpec& m) { return !m.face.empty() || m.bore.has_value() || m.by_nodes() || !m.edge.empty(); }

std::string face_name(const MarkerSpec& m) {
  return fmt::format("{} of '{}'",
                     !m.face.empty()     ? fmt::format("face '{}'", m.face)
                     : !m.nodes.empty()  ? fmt::format("nodes '{}'", m.nodes)
                     : !m.labels.empty() ? fmt::format("nodes {}", fmt::join(m.labels, ", "))
                     : !m.edge.empty()   ? fmt::format("edge '{}'", fmt::join(m.edge, " "))
                                         : std::string("the bore"),
                     m.body);
}

/// The same check for two axes that cross.
void check_both_axes(const JointSpec& j, const JointKind& kind) {
  if (kind.axes != JointKind::Axes::both) return;
  for (const std::size_t k : {0, 1})
    if (!j.frames[k].axis_given)
      throw std::invalid_argument(
          fmt::format("needs an axis of its own in frame '{}' as in the other one: axis = [x, y, z], {}", "ab"[k],
                      k == 1                           ? "about which the wheel turns"
                      : j.type == JointType::rack_pair ? "along the rack"
                                                       : "about which the worm turns"));
}

bool turns_frame(const JointKind& kind, std::size_t frame) { return frame == 0 ? kind.turns_a : kind.turns_b; }

bool turns_frames(const ForceSpec& f) {
  if (f.type != ForceType::load) return force_kind(f.type).turns;
  return f.follower || !f.angular.isZero() ||
         std::any_of(f.components.begin() + 3, f.components.end(), [](const auto& c) { return c.has_value(); });
}

/// A node set has a place; where axes are asked for, it turns as its nodes do in the mean, like a face.
void give_axes(MarkerSpec& m) {
  if (m.by_nodes() && m.attach == Attach::automatic) m.attach = Attach::mean;
}

/// What holds a face where nothing says it: all its nodes in a fixed joint, if they are there.
void decide(MarkerSpec& m, const JointSpec& joint, const Mechanism& built, std::vector<std::string>& notices) {
  if (m.attach == Attach::automatic) m.attach = joint.attach;
  if (m.attach != Attach::automatic || joint.type != JointType::fixed || !is_set(m)) return;
  const BuiltBody* body = built.body(m.body);
  if (body == nullptr || body->flexible == nullptr) return;
  const bool reduced = body->reduced != nullptr;
  m.attach = reduced ? Attach::mean : Attach::rigid;
  notices.push_back(
      reduced
          ? fmt::format("{}: holds the mean position and rotation of {}, which may bend and warp: a reduced body has "
                        "no single nodes to clamp",
                        joint.name, face_name(m))
          : fmt::format("{}: clamps {}, all its nodes as one rigid piece (attach = \"rigid\"); attach = \"mean\" "
                        "would hold their mean position and rotation, and let the face bend and warp",
                        joint.name, face_name(m)));
}

void check_attach(const MarkerSpec& m, const Mechanism& built) {
  if (m.attach != Attach::rigid) return;
  const BuiltBody* body = built.body(m.body);
  if (!is_set(m))
    fail(m.place,
         "attach = \"rigid\" needs a face, an edge, a bore or a node set, whose nodes are to be one rigid piece");
  if (body != nullptr && body->reduced != nullptr)
    fail(m.place, fmt::format("'{}' is reduced, and has no single nodes to hold rigidly: attach = \"mean\", or no "
                              "'reduce'",
                              m.body));
}

}  // namespace

JointSpec completed(const JointSpec& joint, const FrameBuilder& frames, const Mechanism& built,
                    std::vector<std::string>& notices) {
  JointSpec out = joint;
  const JointKind& kind = joint_kind(joint.type);
  bool face = false;
  for (MarkerSpec& m : out.frames) {
    m = frames.resolve(m);
    face = face || is_set(m);
    if (is_set(m)) decide(m, joint, built, notices);
    if (turns_frame(kind, at(&m - out.frames.data()))) give_axes(m);
    check_attach(m, built);
  }
  if (joint.attach != Attach::automatic && !face)
    throw std::invalid_argument("'attach' says how a face is held, and none of the joint's frames is one");
  complete_axes(out, kind.name, frames);
  check_both_axes(out, kind);
  if (kind.complete != nullptr) kind.complete(out, frames);
  return out;
}

ForceSpec completed(const ForceSpec& force, const FrameBuilder& frames, const Mechanism& built) {
  ForceSpec out = force;
  for (MarkerSpec& m : out.frames) {
    m = frames.resolve(m);
    if (turns_frames(force)) give_axes(m);
    check_attach(m, built);
  }
  complete_axes(out, force_kind(force.type).name, frames);
  return out;
}

void hold_rigidly(const MarkerSpec& marker, const FrameBuilder& frames, Mechanism& out) {
  const BuiltBody* body = out.body(marker.body);
  if (marker.attach != Attach::rigid || body == nullptr) return;
  const FlexibleBody& flexible = *body->flexible;
  const std::vector<HeldPoint> points = frames.held_points(marker, *body);
  std::vector<Index> vertices;
  for (const HeldPoint& point : points) vertices.push_back(point.parts.front().first);
  if (!out.rigid_pieces.insert({marker.body, vertices}).second) return;
  const std::array<std::size_t, 3> base = FrameBuilder::base_points(points);
  const auto name = [&](std::size_t k) { return fmt::format("{}, {}", face_name(marker), points[k].name); };
  const Vec3 centre = FrameBuilder::make_base(marker, *body, points).second;
  for (std::size_t i = 0; i < 3; ++i) {
    const HeldPoint &from = points[base[i]], &to = points[base[(i + 1) % 3]];
    out.system.add(distance_joint(name(base[i]), make_point_frame(flexible, from), make_point_frame(flexible, to),
                                  (to.reference - from.reference).norm()));
  }
  for (std::size_t k = 0; k < points.size(); ++k) {
    if (std::find(base.begin(), base.end(), k) != base.end()) continue;
    auto frame = FrameBuilder::make_base(marker, *body, points).first;
    const Vec3 offset = frame->axes().transpose() * (points[k].reference - centre);
    out.system.add(spherical_joint(name(k), std::make_unique<CarriedFrame>(std::move(frame), offset, Mat3::Identity()),
                                   make_point_frame(flexible, points[k])));
  }
}

}  // namespace espalier::dynamics::model

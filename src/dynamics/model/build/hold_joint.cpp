#include "dynamics/model/build/hold_joint.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "dense/dense.hpp"
#include "dynamics/bodies/carried_frame.hpp"
#include "dynamics/joints/space_curve.hpp"
#include "dynamics/model/joint_kinds/kind.hpp"

namespace espalier::dynamics::model {
namespace {

/// The turn that brings one direction to another, nearest.
Mat3 bring(const Vec3& from, const Vec3& to) { return dense::rotation_between(from, to); }

double angle_of(const Mat3& r) { return Eigen::AngleAxisd(r).angle(); }

/// The axes that agree with those of a up to half turns, and are nearest to those of b: the equations of a fixed joint
/// hold for any of the four.
Mat3 nearest_axes(const Mat3& a, const Mat3& b) {
  const Mat3 relative = a.transpose() * b;
  Mat3 best = Mat3::Identity();
  for (const Vec3& flip : {Vec3(1, -1, -1), Vec3(-1, 1, -1), Vec3(-1, -1, 1)})
    if ((flip.asDiagonal() * relative).trace() > (best * relative).trace()) best = flip.asDiagonal();
  return a * best;
}

using Turn = JointHold::Turn;

/// Axes of the frame that moves (m) beside those of the one that stays.
Mat3 wanted_axes(Turn turn, const Mat3& m, const Mat3& stays, bool a_moves) {
  if (turn == Turn::all) return nearest_axes(stays, m);
  if (turn == Turn::axis) {
    const Vec3 z = stays.col(2), own = m.col(2);
    return bring(own, own.dot(z) < 0 ? Vec3(-z) : z) * m;
  }
  if (turn == Turn::cross) {  // x of a and y of b stay perpendicular
    const Vec3 own = m.col(a_moves ? 0 : 1), other = stays.col(a_moves ? 1 : 0);
    const Vec3 beside = own - own.dot(other) * other;
    if (beside.norm() > 0) return bring(own, beside) * m;
  }
  return m;
}

/// Where one of two frames has to be for a joint to fit, and how far that is.
struct Move {
  double distance = 0, angle = 0;
  Vec3 target;
  Mat3 axes;
};

Move move_of(const JointHold& demand, const FrameMotion& a, const FrameMotion& b, bool a_moves) {
  Move m;
  m.axes = a_moves ? wanted_axes(demand.turn, a.rot, b.rot, true) : wanted_axes(demand.turn, b.rot, a.rot, false);
  const Mat3& base = a_moves ? m.axes : a.rot;
  const Vec3 held =
      base *
      Vec3(demand.x ? 1 : 0.0, demand.y ? 1 : 0.0, demand.z ? 1 : 0.0).cwiseProduct(base.transpose() * (b.r - a.r));
  m.distance = held.norm();
  m.angle = angle_of((a_moves ? a.rot : b.rot).transpose() * m.axes);
  m.target = a_moves ? Vec3(a.r + held) : Vec3(b.r - held);
  return m;
}

/// From the origin of b to the curve or surface of a; zero where there is none.
Vec3 gap_of(const JointSpec& joint, const FrameMotion& a, const FrameMotion& b) {
  const Vec3 start = a.rot.transpose() * (b.r - a.r);
  Vec3 p = start;
  if (joint.curve) p = joint.curve->at(joint.curve->nearest(start)).x;
  constexpr int kSteps = 50;  // of Newton's method
  for (int k = 0; joint.surface && k < kSteps; ++k) {
    const PointFunction::At at = joint.surface->at(p);
    p -= at.value / at.gradient.squaredNorm() * at.gradient;
  }
  return a.rot * (p - start);
}

/// The same as move_of() for points on curves and surfaces.
Move move_by(const Vec3& gap, const FrameMotion& a, const FrameMotion& b, bool a_moves) {
  Move m;
  m.distance = gap.norm();
  m.target = a_moves ? Vec3(a.r - gap) : Vec3(b.r + gap);
  m.axes = a_moves ? a.rot : b.rot;
  return m;
}

/// Largest extent of a body's nodes.
double size_of(const FlexibleBody& body) {
  Vec3 low = Vec3::Constant(1e300), high = -low;
  for (std::size_t i = 0; i < body.reference().size(); i += 3 * static_cast<std::size_t>(body.vertices_per_node())) {
    const Eigen::Map<const Vec3> x(body.reference().data() + i);
    low = low.cwiseMin(x);
    high = high.cwiseMax(x);
  }
  return (high - low).maxCoeff();
}

std::string name_of(const MarkerSpec& m) {
  if (m.body == "ground") return "the ground";
  const std::string what = !m.face.empty()    ? fmt::format("face '{}'", m.face)
                           : m.bore           ? std::string("the bore")
                           : !m.nodes.empty() ? fmt::format("nodes '{}'", m.nodes)
                           : m.by_nodes()     ? std::string("the nodes")
                           : !m.edge.empty()  ? std::string("the edge")
                           : m.node           ? fmt::format("node {}", *m.node)
                           : m.near           ? std::string("the node")
                                              : std::string("the point");
  return fmt::format("{} of '{}'", what, m.body);
}

std::string text_of(const Move& m) {
  std::string text;
  if (m.distance > 0) text = fmt::format("{:.3g} apart", m.distance);
  if (m.angle > 1e-9) text += fmt::format("{}turned by {:.3g} rad", text.empty() ? "" : " and ", m.angle);
  return text;
}

/// The two frames of a joint and which of them can be moved without straining anything.
class Holder {
 public:
  Holder(const JointSpec& joint, const FrameBuilder& frames, const Mechanism& built)
      : joint_(joint), frames_(frames), built_(built) {
    for (const std::size_t k : {0, 1}) {
      marker_[k] = frames.resolve(joint.frames[k]);
      frame_[k] = frames.make(joint.frames[k]);
      motion_[k] = frames.initial_motion(joint.frames[k]);
    }
  }

  std::vector<FramePtr> run(std::vector<std::string>& notices) {
    const JointHold& demand = joint_kind(joint_.type).hold;
    const bool fits_somewhere = demand.any || joint_.curve || joint_.surface;
    if (fits_somewhere && !joint_.pull && (flexible(0) || flexible(1))) hold(demand, notices);
    std::vector<FramePtr> result;
    for (FramePtr& frame : frame_) result.push_back(std::move(frame));
    return result;
  }

 private:
  [[nodiscard]] const BuiltBody* flexible(std::size_t k) const {
    const BuiltBody* body = built_.body(marker_[k].body);
    return body != nullptr && body->flexible != nullptr ? body : nullptr;
  }

  void hold(const JointHold& demand, std::vector<std::string>& notices) {
    constexpr double kFits = 1e-9;  // of the body's size: round-off of its mesh
    double size = 0;
    for (const std::size_t k : {0, 1})
      if (const BuiltBody* body = flexible(k)) size = std::max(size, size_of(*body->flexible));
    const auto moves = [&](std::size_t k) { return flexible(k) != nullptr && frame_[k]->has_rotation(); };
    // A frame with axes on a flexible body; else one that is no node.
    const std::size_t k = moves(1) ? 1 : moves(0) ? 0 : flexible(1) == nullptr ? 1 : 0;
    const Move m = demand.any ? move_of(demand, motion_[0], motion_[1], k == 0)
                              : move_by(gap_of(joint_, motion_[0], motion_[1]), motion_[0], motion_[1], k == 0);
    if (m.distance <= kFits * size && m.angle <= kFits) return;
    if (flexible(k) != nullptr && !frame_[k]->has_rotation()) return;  // two nodes: the joint pulls them together
    frame_[k] = flexible(k) != nullptr ? moved_on_body(k, m) : moved_freely(k, m);
    const std::size_t held = flexible(k) != nullptr ? k : 1 - k;
    notices.push_back(
        fmt::format("{}: holds {} where it is; the frames of the joint were {} (pull = true would bring "
                    "them together, and strain the body)",
                    joint_.name, name_of(marker_[held]), text_of(m)));
  }

  /// The weights of a face are shifted where they all stay positive; else its mean carries the frame.
  FramePtr moved_on_body(std::size_t k, const Move& m) {
    const BodySpec& body = flexible(k)->spec;
    MarkerSpec marker = marker_[k];
    if ((!marker.face.empty() || marker.bore) && !marker.point_given) {
      marker.global = false;
      marker.point_given = true;
      marker.point = body.rotation.transpose() * (m.target - body.position);
      marker.axes = body.rotation.transpose() * m.axes;
      try {
        return frames_.make(marker);
      } catch (const Error&) {  // too far for that
      }
    }
    const Mat3 back = motion_[k].rot.transpose();
    return std::make_unique<CarriedFrame>(std::move(frame_[k]), back * (m.target - motion_[k].r), back * m.axes);
  }

  FramePtr moved_freely(std::size_t k, const Move& m) {
    MarkerSpec marker = marker_[k];
    marker.global = true;
    marker.point = m.target;
    marker.axes = m.axes;
    return frames_.make(marker);
  }

  const JointSpec& joint_;
  const FrameBuilder& frames_;
  const Mechanism& built_;
  MarkerSpec marker_[2];
  FramePtr frame_[2];
  FrameMotion motion_[2];
};

}  // namespace

std::vector<FramePtr> held_frames(const JointSpec& joint, const FrameBuilder& frames, const Mechanism& built,
                                  std::vector<std::string>& notices) {
  return Holder(joint, frames, built).run(notices);
}

}  // namespace espalier::dynamics::model

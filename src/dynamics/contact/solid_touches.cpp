// What the points of a solid in contact touch, and the forces there.
#include <algorithm>
#include <cmath>

#include "dynamics/contact/geometry/narrow.hpp"
#include "dynamics/contact/solid_contact.hpp"

namespace espalier::dynamics::contact {

std::optional<SolidContact::Acting> SolidContact::act_rigid(std::size_t k, const FacePlace& at) const {
  const Memory& memory = memory_[k];
  thread_local std::vector<Touch> touches;
  touches.clear();
  const double radius = first_.face(points_[k].spot.face).radius;
  touch_corner(placed_, {0, at.x, memory.layer + radius, true}, 0, touches);
  if (touches.empty()) return {};
  Acting acting;
  acting.point = k;
  acting.touch =
      *std::min_element(touches.begin(), touches.end(), [](const Touch& a, const Touch& b) { return a.gap < b.gap; });
  acting.touch.at_second = true;
  acting.gap = acting.touch.gap + memory.layer;
  acting.direction = acting.touch.normal;
  BodyMotion point;
  point.origin = at.x;
  point.velocity = velocity_of_point(k, at);
  const TouchForce force = touch_force(law_, law_.damping, acting.touch, shape_motion_, point,
                                       memory.touched ? &memory.ends : nullptr, nullptr);
  acting.normal = force.normal;
  acting.friction = force.friction;
  acting.slip_rate = force.slip_rate;
  acting.stretch = force.stretch;
  return acting;
}

// The face that was opposite when the point was made, then whatever is near. Between faces of a curved surface, where a
// point lies beyond the sides of both by a little, the nearer one goes on.
std::optional<FaceSpot> SolidContact::spot_opposite(std::size_t k, const FacePlace& at, double reach) {
  const ContactPoint& point = points_[k];
  constexpr double kOnFace = 1e-8, kBeyond = 0.02;
  const SurfaceFace& own = first_.face(point.spot.face);
  const Vec3 outwards = own.is_line() ? Vec3(Vec3::Zero()) : at.normal_area();
  const auto project = [&](Index f, double& distance) {
    const SurfaceFace& face = second_->face(f);
    if (!may_be_over(face, at.x, face.depth, reach)) return FaceProjection{};
    FaceProjection p = project_on_face(face, at.x, f == point.opposite ? &made_at_[k] : nullptr);
    if (p.outside > kBeyond) return p;
    const FacePlace there = face_place(face, p.xi.data());
    if (face.is_line()) {
      distance = (at.x - there.x).norm() - face.radius;
      if (distance > reach) p.outside = 1e300;
      return p;
    }
    const Vec3 normal = there.normal_area();
    distance = normal.normalized().dot(at.x - there.x);
    // Within one body all faces may be looked at: those around an edge must not take what belongs to its end.
    const double facing = one_body() ? kFacing * normal.norm() * outwards.norm() : 0;
    const bool same_side = !own.is_line() && normal.dot(outwards) >= facing;
    if (same_side || distance > reach || distance < -face.depth) p.outside = 1e300;
    return p;
  };
  double distance = 0;
  FaceProjection best;
  if (point.opposite >= 0) best = project(point.opposite, distance);
  if (best.outside <= kOnFace) return FaceSpot{point.opposite, best.xi};
  FaceSpot found{best.outside <= kBeyond ? point.opposite : -1, best.xi};
  double nearest = std::numeric_limits<double>::infinity();
  Box around;
  around.add(at.x);
  around.widen(second_->is_line() ? reach : std::max(reach, 0.5 * second_->mean_size()));
  second_->tree().query(around, [&](Index f) {
    if (f == point.opposite || (one_body() && are_neighbours(second_->face(f), own))) return;
    const FaceProjection p = project(f, distance);
    const bool inside = p.outside <= kOnFace, had_inside = best.outside <= kOnFace;
    if (p.outside > kBeyond) return;
    const bool better =
        inside ? !had_inside || std::abs(distance) < nearest || (std::abs(distance) == nearest && f < found.face)
               : !had_inside && p.outside < best.outside;
    if (!better) return;
    best = p;
    nearest = std::abs(distance);
    found = {f, p.xi};
  });
  if (found.face < 0) return {};
  return found;
}

std::optional<SolidContact::Acting> SolidContact::act_solid(std::size_t k, const FacePlace& at) {
  const Memory& memory = memory_[k];
  const SurfaceFace& own = first_.face(points_[k].spot.face);
  const std::optional<FaceSpot> spot = spot_opposite(k, at, memory.layer + own.radius);
  if (!spot) return {};
  const SurfaceFace& other = second_->face(spot->face);
  const FaceTouch touch(at, own.count(), other, spot->xi);
  const double penetration = memory.layer + own.radius - touch.gap();
  if (!(penetration > 0)) return {};
  Acting acting;
  acting.point = k;
  acting.gap = touch.gap() - own.radius;
  acting.opposite = spot;
  const Vec3& n = acting.direction = touch.normal();
  Vec3 relative = velocity_of_point(k, at);
  for (std::size_t a = 0; a < other.v.size(); ++a) relative -= touch.opposite().value[a] * other.v[a];
  acting.normal = normal_force(law_, penetration, -n.dot(relative), law_.damping);
  if (!law_.rubs()) return acting;
  if (memory.touched) {
    const Vec3 between = from_spring_end(k, at);
    acting.stretch = between - n * n.dot(between);
  }
  if (other.is_line()) {
    const Vec3 rate = face_place(other, other.v, spot->xi.data()).tangent[0];
    relative += line_turn(touch.opposite().tangent[0], rate, at.x - touch.opposite().x).gain;
  }
  acting.slip_rate = relative - n * n.dot(relative);
  acting.friction = friction_force(law_, acting.normal.force, acting.stretch, acting.slip_rate);
  return acting;
}

}  // namespace espalier::dynamics::contact

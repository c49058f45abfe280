// What of a shape lies next to a point.
#include <cmath>

#include "dynamics/contact/geometry/narrow.hpp"

namespace espalier::dynamics::contact {
namespace {

constexpr double kNothing = 1e-14;  // below this part of the size a direction is none

/// Builds the touches of one corner with one shape.
class CornerTouches {
 public:
  CornerTouches(const PlacedShape& shape, const Corner& corner, double reach, std::vector<Touch>& out)
      : shape_(shape), corner_(corner), reach_(reach), out_(out), own_(shape.to_own(corner.point)) {}

  void operator()(const PlaneShape& /*plane*/) const { add_face(0, Vec3::UnitZ(), own_[2]); }

  void operator()(const SphereShape& s) const { add_point(0, Vec3::Zero(), s.radius); }

  void operator()(const CapsuleShape& c) const {
    if (std::abs(own_[2]) > c.half_length)
      add_point(own_[2] > 0 ? 1 : 2, {0, 0, std::copysign(c.half_length, own_[2])}, c.radius);
    else
      add_line(0, {0, 0, own_[2]}, Vec3::UnitZ(), c.radius);
  }

  void operator()(const CylinderShape& c) const {
    const double rho = std::hypot(own_[0], own_[1]), above = std::abs(own_[2]) - c.half_length;
    const double side = std::copysign(1.0, own_[2]);
    const Index end = side > 0 ? 1 : 2;
    if (above > 0 && rho > c.radius) return add_rim(end, c, side * c.half_length, rho);
    if (above > 0 || (rho <= c.radius && above > rho - c.radius)) return add_face(end, side * Vec3::UnitZ(), above);
    add_line(0, {0, 0, own_[2]}, Vec3::UnitZ(), c.radius);
  }

  void operator()(const BoxShape& b) const {
    const Vec3 beyond = own_.cwiseAbs() - b.half;
    int outside = 0, free = 0;
    for (int i = 0; i < 3; ++i) outside += beyond[i] > 0 ? 1 : 0;
    Index place = 0;  // which of the 27 parts of space
    Vec3 nearest = own_;
    for (int i = 0; i < 3; ++i) {
      place *= 3;
      if (beyond[i] <= 0) {
        free = i;
        continue;
      }
      nearest[i] = std::copysign(b.half[i], own_[i]);
      place += own_[i] > 0 ? 2 : 1;
    }
    if (outside == 3) return add_point(place, nearest, 0);
    if (outside == 2) return add_line(place, nearest, Vec3::Unit(free), 0);
    Eigen::Index axis = 0;
    const double distance = beyond.maxCoeff(&axis);
    const double sign = std::copysign(1.0, own_[axis]);
    const auto face = static_cast<Index>(27 + 2 * axis + (sign > 0 ? 1 : 0));
    add_face(face, sign * Vec3::Unit(axis), distance);
  }

  void operator()(const MeshShape& m) const {
    thread_local std::vector<TriangleSurface::Near> near;
    near.clear();
    const TriangleSurface& s = *m.surface;
    const bool sharp = corner_.alone || corner_.radius == 0;
    const double within = reach_ + corner_.radius;
    // What is outside of all of a closed surface is not below its faces.
    if (sharp && s.closed() && !(s.tree().all().distance_squared(own_) <= within * within)) return;
    s.near(own_, std::max(within, sharp ? s.depth() : 0), sharp, near);
    for (const TriangleSurface::Near& n : near) {
      using Kind = TriangleSurface::Near::Kind;
      if (n.kind == Kind::face && n.distance > -s.depth()) {
        add_face(n.id, s.normal(n.id), n.distance);
      } else if (n.kind == Kind::edge) {
        const auto& e = s.edges()[static_cast<std::size_t>(n.id)];
        const Vec3 along = s.points()[static_cast<std::size_t>(e.b)] - s.points()[static_cast<std::size_t>(e.a)];
        add_line(n.id, n.point, along.normalized(), 0);
      } else if (n.kind == Kind::vertex) {
        add_point(n.id, n.point, 0);
      }
    }
  }

 private:
  static constexpr unsigned kFace = 1, kLine = 2, kPoint = 3, kRim = 4;  // what was found

  void add(unsigned kind, Index id, Touch touch) const {
    touch.id = touch_id(0, corner_.id, static_cast<Index>(kind) << 28U | id);
    touch.second.point = corner_.point;
    touch.second.radius = corner_.radius;
    out_.push_back(touch);
  }

  /// @param distance of the corner from the plane, along its normal in own axes
  void add_face(Index id, const Vec3& normal, double distance) const {
    Touch touch;
    touch.gap = distance - corner_.radius;
    if (!(touch.gap < reach_)) return;
    touch.normal = shape_.axes * normal;
    touch.first.dimension = 2;
    touch.first.point = corner_.point - distance * touch.normal;
    add(kFace, id, touch);
  }

  void add_curve(unsigned kind, Index id, const Vec3& at, Feature first) const {
    const Vec3 w = corner_.point - shape_.to_global(at);
    const double distance = w.norm();
    Touch touch;
    touch.gap = distance - corner_.radius - first.radius;
    if (!(touch.gap < reach_) || !(distance > kNothing * (corner_.radius + first.radius))) return;
    touch.normal = w / distance;
    first.point = shape_.to_global(at);
    touch.first = first;
    add(kind, id, touch);
  }

  void add_point(Index id, const Vec3& at, double radius) const {
    Feature first;
    first.radius = radius;
    add_curve(kPoint, id, at, first);
  }

  void add_line(Index id, const Vec3& at, const Vec3& along, double radius) const {
    Feature first;
    first.dimension = 1;
    first.along = shape_.axes * along;
    first.radius = radius;
    add_curve(kLine, id, at, first);
  }

  void add_rim(Index id, const CylinderShape& c, double z, double rho) const {
    const Vec3 outwards(own_[0] / rho, own_[1] / rho, 0);
    Feature first;
    first.dimension = 1;
    first.along = shape_.axes * Vec3::UnitZ().cross(outwards);
    first.curvature = shape_.axes * outwards / -c.radius;
    add_curve(kRim, id, c.radius * outwards + z * Vec3::UnitZ(), first);
  }

  const PlacedShape& shape_;
  const Corner& corner_;
  double reach_;
  std::vector<Touch>& out_;
  Vec3 own_;  // the corner in the axes of the shape
};

}  // namespace

void touch_corner(const PlacedShape& shape, const Corner& corner, double reach, std::vector<Touch>& out) {
  std::visit(CornerTouches(shape, corner, reach, out), *shape.shape);
}

}  // namespace espalier::dynamics::contact

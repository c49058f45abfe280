#include "dynamics/contact/geometry/narrow.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "base/at.hpp"

namespace espalier::dynamics::contact {
namespace {

constexpr int kRimPoints = 8;
constexpr double kFlatStand = 0.1;  // sine of the tilt (5.7 degrees) up to which a cylinder stands on its end
constexpr double kParallel = 0.05;  // sine of the angle below which lines touch at their ends

template <class T>
const T* shape_if(const PlacedShape& placed) {
  return std::get_if<T>(placed.shape);
}

std::size_t index_of(Index i) { return at(i); }

Vec3 rim_point(const CylinderShape& c, int k) {
  static const auto kCircle = [] {
    std::array<std::array<double, 2>, kRimPoints> circle{};
    for (int step = 0; step < kRimPoints; ++step) {
      const double turn = 2 * std::numbers::pi * step / kRimPoints;
      circle[index_of(step)] = {std::cos(turn), std::sin(turn)};
    }
    return circle;
  }();
  const auto& [x, y] = kCircle[index_of(k / 2)];  // two points at each
  return {c.radius * x, c.radius * y, k % 2 == 0 ? -c.half_length : c.half_length};
}

Vec3 box_corner(const Vec3& half, int k) {
  return {(k & 1) != 0 ? half[0] : -half[0], (k & 2) != 0 ? half[1] : -half[1], (k & 4) != 0 ? half[2] : -half[2]};
}

/// What lies within `reach` of `other`, in the axes of `shape`.
Vicinity vicinity_of(const PlacedShape& shape, const PlacedShape& other, double reach) {
  constexpr double kRounding = 1e-9;
  Vicinity v;
  const PlacedShape own{other.shape, shape.to_own(other.origin), shape.axes.transpose() * other.axes};
  v.box = box_around(own);
  v.box.widen(reach);
  v.origin = own.origin;
  const auto round = [&](double radius, const Vec3& axis) {
    v.radius = (radius + reach) * (1 + kRounding);
    v.axis = axis;
  };
  if (const auto* s = shape_if<SphereShape>(other)) round(s->radius, Vec3::Zero());
  if (const auto* c = shape_if<CapsuleShape>(other)) round(c->radius, own.z());
  if (const auto* c = shape_if<CylinderShape>(other)) round(c->radius, own.z());
  return v;
}

/// The lowest points of the rims over a plane, or points of the rims where the cylinder stands on one of them.
void touch_plane_cylinder(const PlacedShape& plane, const PlacedShape& placed, const CylinderShape& c, double reach,
                          std::vector<Touch>& out) {
  const Vec3 n = plane.z(), axis = placed.z(), down = axis.dot(n) * axis - n;
  const double sine = down.norm();
  if (sine < kFlatStand) {
    for (const Corner& corner : corners_of(placed, {})) touch_corner(plane, corner, reach, out);
    return;
  }
  for (const int end : {0, 1}) {
    const Vec3 radial = down / sine;
    Touch touch;
    touch.second.dimension = 1;
    touch.second.point = placed.to_global({0, 0, end == 0 ? -c.half_length : c.half_length}) + c.radius * radial;
    touch.second.along = axis.cross(radial);
    touch.second.curvature = radial / -c.radius;
    touch.normal = n;
    touch.gap = n.dot(touch.second.point - plane.origin);
    touch.first.dimension = 2;
    touch.first.point = touch.second.point - touch.gap * n;
    touch.id = touch_id(1, end, 0);
    if (touch.gap < reach) out.push_back(touch);
  }
}

/// Whether a normal of an edge points away from the solid beside it.
bool in_arc(const EdgeLine& edge, const Vec3& n) {
  constexpr double kRounding = 1e-12;
  return edge.left.cross(n).dot(edge.along) >= -kRounding && n.cross(edge.right).dot(edge.along) >= -kRounding;
}

/// Two lines that cross, within both segments.
void touch_edges(const EdgeLine& a, const EdgeLine& b, double reach, double depth, std::vector<Touch>& out) {
  const double cosine = a.along.dot(b.along), sine2 = 1 - cosine * cosine;
  if (sine2 < kParallel * kParallel) return;
  const Vec3 between = b.middle - a.middle;
  const double s = (a.along.dot(between) - cosine * b.along.dot(between)) / sine2;
  const double r = (cosine * a.along.dot(between) - b.along.dot(between)) / sine2;
  if (std::abs(s) > a.half || std::abs(r) > b.half) return;
  Touch touch;
  touch.first = {1, a.middle + s * a.along, a.along, Vec3::Zero(), a.radius};
  touch.second = {1, b.middle + r * b.along, b.along, Vec3::Zero(), b.radius};
  const Vec3 w = touch.second.point - touch.first.point;
  Vec3 n = a.along.cross(b.along) / std::sqrt(sine2);
  if (a.radius + b.radius > 0) {
    if (n.dot(w) < 0) n = -n;  // they have not gone through each other's middle
  } else {
    if (n.dot(a.left + a.right) < 0) n = -n;
    if (!in_arc(a, n) || !in_arc(b, -n) || n.dot(w) < -depth) return;
  }
  touch.normal = n;
  touch.gap = n.dot(w) - a.radius - b.radius;
  touch.id = touch_id(2, a.id, b.id);
  if (touch.gap < reach) out.push_back(touch);
}

/// Corners of one shape on the other; `flipped` says which is A. Those of the round ends that find round ends are left
/// to the other way round.
void touch_corners(const PlacedShape& shape, const PlacedShape& other, double reach, bool flipped, bool skip_points,
                   std::vector<Touch>& out) {
  const Vicinity within = shape_if<PlaneShape>(shape) == nullptr ? vicinity_of(other, shape, reach) : Vicinity{};
  for (const Corner& corner : corners_of(other, within)) {
    const std::size_t first = out.size();
    touch_corner(shape, corner, reach, out);
    for (std::size_t k = first; k < out.size(); ++k) {
      out[k].flipped = flipped;
      if (flipped) out[k].id |= std::uint64_t{1} << 63U;
    }
    if (skip_points)
      out.erase(std::remove_if(out.begin() + static_cast<std::ptrdiff_t>(first), out.end(),
                               [](const Touch& t) { return t.first.dimension == 0; }),
                out.end());
  }
}

void touch_all_edges(const PlacedShape& a, const PlacedShape& b, double reach, std::vector<Touch>& out) {
  const std::vector<EdgeLine> of_a = edges_of(a, vicinity_of(a, b, reach));
  if (of_a.empty()) return;
  const double depth = 0.5 * std::min(least_extent(*a.shape), least_extent(*b.shape));
  const std::vector<EdgeLine> of_b = edges_of(b, vicinity_of(b, a, reach));
  for (const EdgeLine& one : of_a)
    for (const EdgeLine& other : of_b) touch_edges(one, other, reach, depth, out);
}

/// Two capsules: the nearest points of their axes, or the ends of both where these are parallel.
void touch_capsules(const PlacedShape& a, const PlacedShape& b, double reach, std::vector<Touch>& out) {
  const std::size_t first = out.size();
  touch_all_edges(a, b, reach, out);
  if (out.size() > first) return;  // the lines cross within both: nothing is nearer
  touch_corners(a, b, reach, false, false, out);
  touch_corners(b, a, reach, true, true, out);
  if (a.z().cross(b.z()).norm() < kParallel || out.size() <= first + 1) return;
  const auto begin = out.begin() + static_cast<std::ptrdiff_t>(first);
  *begin = *std::min_element(begin, out.end(), [](const Touch& x, const Touch& y) { return x.gap < y.gap; });
  out.resize(first + 1);
}

/// Ends of a cylinder's axis as round corners: how parallel cylinders lie on each other.
void touch_parallel_cylinders(const PlacedShape& a, const PlacedShape& b, double reach, bool flipped,
                              std::vector<Touch>& out) {
  const auto &ca = *shape_if<CylinderShape>(a), &cb = *shape_if<CylinderShape>(b);
  for (const int end : {0, 1}) {
    const Vec3 x = b.to_global({0, 0, end == 0 ? -cb.half_length : cb.half_length});
    const Vec3 own = a.to_own(x);
    if (std::abs(own[2]) > ca.half_length || std::hypot(own[0], own[1]) < 0.5 * (ca.radius + cb.radius)) continue;
    const std::size_t first = out.size();
    touch_corner(a, {100 + end, x, cb.radius}, reach, out);
    for (std::size_t k = first; k < out.size(); ++k) {
      out[k].flipped = flipped;
      if (flipped) out[k].id |= std::uint64_t{1} << 63U;
    }
  }
}

void touch_plane(const PlacedShape& plane, const PlacedShape& other, double reach, bool flipped,
                 std::vector<Touch>& out) {
  const std::size_t first = out.size();
  if (const auto* c = shape_if<CylinderShape>(other)) {
    touch_plane_cylinder(plane, other, *c, reach, out);
    for (std::size_t k = first; k < out.size(); ++k) out[k].flipped = flipped;
  } else {
    touch_corners(plane, other, reach, flipped, false, out);
  }
}

}  // namespace

bool Vicinity::holds(const Vec3& x) const {
  const Vec3 w = x - origin;
  const double along = axis.dot(w);
  return !(w.squaredNorm() - along * along > radius * radius);
}

bool Vicinity::meets_segment(const Vec3& a, const Vec3& b) const {
  if (axis.isZero(0)) return true;
  constexpr double kParallelEnough = 0.99 * kParallel;
  const Vec3 along = b - a, normal = along.cross(axis);
  const double square = normal.squaredNorm(), distance = normal.dot(origin - a);
  if (square < kParallelEnough * kParallelEnough * along.squaredNorm()) return false;
  return !(distance * distance > radius * radius * square);
}

std::vector<Corner> corners_of(const PlacedShape& p, const Vicinity& within) {
  std::vector<Corner> corners;
  const auto add = [&](Index id, const Vec3& own, double radius) { corners.push_back({id, p.to_global(own), radius}); };
  if (const auto* s = shape_if<SphereShape>(p)) add(0, Vec3::Zero(), s->radius);
  if (const auto* c = shape_if<CapsuleShape>(p))
    for (const int end : {0, 1}) add(end, {0, 0, end == 0 ? -c->half_length : c->half_length}, c->radius);
  if (const auto* c = shape_if<CylinderShape>(p))
    for (int k = 0; k < 2 * kRimPoints; ++k) add(k, rim_point(*c, k), 0);
  if (const auto* b = shape_if<BoxShape>(p))
    for (int k = 0; k < 8; ++k) add(k, box_corner(b->half, k), 0);
  if (const auto* m = shape_if<MeshShape>(p)) {
    const auto& points = m->surface->points();
    if (!(within.box.low.array() <= within.box.high.array()).all()) {  // everywhere
      for (std::size_t k = 0; k < points.size(); ++k) add(static_cast<Index>(k), points[k], 0);
    } else {
      m->surface->point_tree().query(within.box, [&](Index k) {
        if (within.holds(points[index_of(k)])) add(k, points[index_of(k)], 0);
      });
      std::sort(corners.begin(), corners.end(), [](const Corner& x, const Corner& y) { return x.id < y.id; });
    }
  }
  return corners;
}

std::vector<EdgeLine> edges_of(const PlacedShape& p, const Vicinity& within) {
  std::vector<EdgeLine> edges;
  if (const auto* c = shape_if<CapsuleShape>(p)) edges.push_back({0, p.origin, p.z(), c->half_length, c->radius});
  if (const auto* c = shape_if<CylinderShape>(p)) edges.push_back({0, p.origin, p.z(), c->half_length, c->radius});
  if (const auto* b = shape_if<BoxShape>(p)) {
    for (int k = 0; k < 12; ++k) {
      const int i = k / 4, j = (i + 1) % 3, l = (i + 2) % 3;
      const double sj = (k & 1) != 0 ? 1 : -1, sl = (k & 2) != 0 ? 1 : -1;
      Vec3 middle = Vec3::Zero();
      middle[j] = sj * b->half[j];
      middle[l] = sl * b->half[l];
      EdgeLine edge{k, p.to_global(middle), p.axes.col(i), b->half[i], 0, sj * p.axes.col(j), sl * p.axes.col(l)};
      if (edge.left.cross(edge.right).dot(edge.along) < 0) std::swap(edge.left, edge.right);
      edges.push_back(edge);
    }
  }
  if (const auto* m = shape_if<MeshShape>(p)) {
    const TriangleSurface& s = *m->surface;
    std::vector<Index> found;
    s.edge_tree().query(within.box, [&](Index k) {
      const auto& e = s.edges()[index_of(s.ridges()[index_of(k)])];
      if (within.meets_segment(s.points()[index_of(e.a)], s.points()[index_of(e.b)])) found.push_back(k);
    });
    std::sort(found.begin(), found.end());
    for (const Index k : found) {
      const auto& e = s.edges()[index_of(s.ridges()[index_of(k)])];
      const Vec3 a = p.to_global(s.points()[index_of(e.a)]), b = p.to_global(s.points()[index_of(e.b)]);
      const double length = (b - a).norm();
      EdgeLine edge{k, 0.5 * (a + b), (b - a) / length, 0.5 * length};
      edge.left = p.axes * s.normal(e.left);
      edge.right = e.right < 0 ? Vec3(edge.left.cross(edge.along) * -1) : Vec3(p.axes * s.normal(e.right));
      edges.push_back(edge);
    }
  }
  return edges;
}

bool can_touch(const Shape& a, const Shape& b) {
  return !(std::holds_alternative<PlaneShape>(a) && std::holds_alternative<PlaneShape>(b));
}

void find_touches(const PlacedShape& a, const PlacedShape& b, double reach, std::vector<Touch>& out) {
  if (shape_if<PlaneShape>(a) != nullptr) return touch_plane(a, b, reach, false, out);
  if (shape_if<PlaneShape>(b) != nullptr) return touch_plane(b, a, reach, true, out);
  if (shape_if<SphereShape>(b) != nullptr) return touch_corners(a, b, reach, false, false, out);
  if (shape_if<SphereShape>(a) != nullptr) return touch_corners(b, a, reach, true, false, out);
  const bool capsule_a = shape_if<CapsuleShape>(a) != nullptr, capsule_b = shape_if<CapsuleShape>(b) != nullptr;
  if (capsule_a && capsule_b) return touch_capsules(a, b, reach, out);
  if (shape_if<BoxShape>(a) != nullptr && shape_if<BoxShape>(b) != nullptr) return touch_boxes(a, b, reach, out);
  const bool cylinder_a = shape_if<CylinderShape>(a) != nullptr, cylinder_b = shape_if<CylinderShape>(b) != nullptr;
  if (cylinder_a && cylinder_b && a.z().cross(b.z()).norm() < kParallel) {
    const std::size_t first = out.size();
    touch_parallel_cylinders(a, b, reach, false, out);
    touch_parallel_cylinders(b, a, reach, true, out);
    if (out.size() > first) return;
  }
  touch_corners(b, a, reach, true, false, out);
  touch_corners(a, b, reach, false, capsule_a || capsule_b, out);
  touch_all_edges(a, b, reach, out);
}

}  // namespace espalier::dynamics::contact

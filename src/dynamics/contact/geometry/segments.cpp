#include "dynamics/contact/geometry/segments.hpp"

#include <algorithm>
#include <cmath>

#include "dynamics/elements/shape_functions.hpp"

namespace espalier::dynamics::contact {
namespace {

using Vec2 = Eigen::Vector2d;
using Polygon = std::vector<Vec2>;

/// Radon's rule of seven points, degree five, on the triangle of area one (J. Radon 1948; Strang and Fix 1973).
struct TrianglePoint {
  double a, b, weight;
};
std::vector<TrianglePoint> rule_of_seven() {
  const double root = std::sqrt(15.0), p = (6 - root) / 21, r = (6 + root) / 21;
  const double wp = (155 - root) / 1200, wr = (155 + root) / 1200;
  return {{1.0 / 3, 1.0 / 3, 9.0 / 40}, {p, p, wp},        {1 - 2 * p, p, wp}, {p, 1 - 2 * p, wp}, {r, r, wr},
          {1 - 2 * r, r, wr},           {r, 1 - 2 * r, wr}};
}

/// The plane of a face: through its middle, normal to its normal there.
struct FacePlane {
  Vec3 origin, e1, e2, normal;
  explicit FacePlane(const SurfaceFace& face) {
    const bool triangle = face.is_triangle();
    const double third = 1.0 / 3;
    const double xi[2] = {triangle ? third : 0, triangle ? third : 0};
    const FacePlace middle = face_place(face, xi);
    origin = middle.x;
    normal = middle.normal_area().normalized();
    e1 = middle.tangent[0].normalized();
    e2 = normal.cross(e1);
  }
  [[nodiscard]] Vec2 flat(const Vec3& x) const { return {e1.dot(x - origin), e2.dot(x - origin)}; }
  [[nodiscard]] Vec3 point(const Vec2& y) const { return origin + y[0] * e1 + y[1] * e2; }
};

/// Corners and, of quadratic faces, nodes between them, in their order around the face.
Polygon outline(const SurfaceFace& face, const FacePlane& plane) {
  const auto corners = static_cast<std::size_t>(shape_of(face.type).corners);
  Polygon polygon;
  for (std::size_t k = 0; k < corners; ++k) {
    polygon.push_back(plane.flat(face.x[k]));
    if (face.x.size() > corners) polygon.push_back(plane.flat(face.x[corners + k]));
  }
  return polygon;
}

double twice_area(const Polygon& p) {
  double sum = 0;
  for (std::size_t k = 0; k < p.size(); ++k) {
    const Vec2 &a = p[k], &b = p[(k + 1) % p.size()];
    sum += a[0] * b[1] - a[1] * b[0];
  }
  return sum;
}

/// What of `polygon` lies in the convex polygon `window`, both anticlockwise (Sutherland and Hodgman).
Polygon common(Polygon polygon, const Polygon& window) {
  for (std::size_t k = 0; k < window.size() && !polygon.empty(); ++k) {
    const Vec2& a = window[k];
    const Vec2 side = window[(k + 1) % window.size()] - a;
    const auto inside = [&](const Vec2& x) { return side[0] * (x[1] - a[1]) - side[1] * (x[0] - a[0]); };
    Polygon kept;
    for (std::size_t i = 0; i < polygon.size(); ++i) {
      const Vec2 &x = polygon[i], &y = polygon[(i + 1) % polygon.size()];
      const double dx = inside(x), dy = inside(y);
      if (dx >= 0) kept.push_back(x);
      if ((dx > 0 && dy < 0) || (dx < 0 && dy > 0)) kept.push_back(x + dx / (dx - dy) * (y - x));
    }
    polygon = std::move(kept);
  }
  return polygon;
}

/// The place on a face over a point of its plane: the projection along the plane's normal. Newton from the middle.
bool place_over(const SurfaceFace& face, const FacePlane& plane, const Vec2& y, std::array<double, 2>& xi) {
  const bool triangle = face.is_triangle();
  xi = triangle ? std::array{1.0 / 3, 1.0 / 3} : std::array{0.0, 0.0};
  constexpr int kMostPasses = 20;
  for (int pass = 0; pass < kMostPasses; ++pass) {
    const FacePlace at = face_place(face, xi.data());
    Eigen::Matrix2d k;
    k.col(0) << plane.e1.dot(at.tangent[0]), plane.e2.dot(at.tangent[0]);
    k.col(1) << plane.e1.dot(at.tangent[1]), plane.e2.dot(at.tangent[1]);
    const Vec2 step = k.inverse() * (y - plane.flat(at.x));
    if (!step.allFinite()) return false;
    xi[0] += step[0];
    xi[1] += step[1];
    if (step.cwiseAbs().maxCoeff() < 1e-14) return true;
  }
  return true;
}

/// Whether a point of a face lies so far below another one that it is on the other side of their body.
bool lies_behind(const SurfaceFace& face, const SurfaceFace& other, const FacePlane& plane, const Vec2& y) {
  std::array<double, 2> on_face{}, on_other{};
  if (!place_over(face, plane, y, on_face) || !place_over(other, plane, y, on_other)) return true;
  const FacePlace there = face_place(other, on_other.data());
  return there.normal_area().normalized().dot(face_place(face, on_face.data()).x - there.x) < -other.depth;
}

void add_triangle(const SurfaceFace& face, const FacePlane& plane, const std::array<Vec2, 3>& t, ContactPoint point,
                  std::vector<ContactPoint>& out) {
  static const std::vector<TrianglePoint> kRule = rule_of_seven();
  const Vec2 ab = t[1] - t[0], ac = t[2] - t[0];
  const double area = 0.5 * (ab[0] * ac[1] - ab[1] * ac[0]);
  if (!(area > 1e-14 * face.size * face.size)) return;
  for (const TrianglePoint& r : kRule) {
    if (!place_over(face, plane, t[0] + r.a * ab + r.b * ac, point.spot.xi)) continue;
    // From the area on the plane to that of the face without stress, over the reference shape.
    const FacePlace now = face_place(face, point.spot.xi.data());
    const FacePlace then = face_place(face, face.reference, point.spot.xi.data());
    const double flat = std::abs(plane.normal.dot(now.normal_area()));
    if (!(flat > 0)) continue;
    point.weight = r.weight * area * then.normal_area().norm() / flat;
    out.push_back(point);
  }
}

/// In each direction.
double divisions_of(const FaceSurface& surface, const SurfaceFace& face, double radius) {
  constexpr double kApart = 0.5;  // of a face: its points, at least
  const double own = surface.divisions();
  return kApart * face.size / own > radius ? std::ceil(face.size / radius) : own;
}

}  // namespace

double count_of_points(const FaceSurface& surface, Index face, double radius) {
  const double parts = divisions_of(surface, surface.face(face), radius);
  return parts * parts * static_cast<double>(face_quadrature(surface.face(face).type).size());
}

void points_of_face(const FaceSurface& surface, Index face, double radius, std::vector<ContactPoint>& out) {
  const SurfaceFace& f = surface.face(face);
  if (f.is_line()) {
    // Abramowitz and Stegun, table 25.6
    static const double kInner = std::sqrt(3.0 / 7);
    static const std::array<std::array<double, 2>, 5> kLobatto = {
        {{-1, 0.1}, {-kInner, 49.0 / 90}, {0, 32.0 / 45}, {kInner, 49.0 / 90}, {1, 0.1}}};
    const double parts = surface.divisions();
    for (int k = 0; k < surface.divisions(); ++k)
      for (const auto& [at, weight] : kLobatto)
        out.push_back({{face, {-1 + (2 * k + 1 + at) / parts, 0}}, 0.5 * weight * f.size / parts, -1});
    return;
  }
  const auto parts = static_cast<int>(divisions_of(surface, f, radius));
  const auto add = [&](const QuadraturePoint& q, double r, double s) {
    const std::array<double, 2> xi = {r, s};
    const double area = face_place(f, f.reference, xi.data()).normal_area().norm();
    out.push_back({{face, xi}, q.weight * area / (1.0 * parts * parts), -1});
  };
  for (int i = 0; i < parts; ++i)
    for (int j = 0; j < parts; ++j)
      for (const QuadraturePoint& q : face_quadrature(f.type)) {
        if (!f.is_triangle())
          add(q, -1 + (2 * i + 1 + q.xi[0]) / parts, -1 + (2 * j + 1 + q.xi[1]) / parts);
        else if (i + j < parts)
          add(q, (i + q.xi[0]) / parts, (j + q.xi[1]) / parts);
        else  // upside down, between those
          add(q, (parts - i - q.xi[0]) / parts, (parts - j - q.xi[1]) / parts);
      }
}

void points_of_segments(const FaceSurface& first, Index face, FaceSurface& second, double reach,
                        std::vector<ContactPoint>& out) {
  const SurfaceFace& f = first.face(face);
  Box around = first.boxes()[static_cast<std::size_t>(face)];
  around.widen(reach);
  std::vector<Index> near;
  second.tree().query(around, [&](Index other) { near.push_back(other); });
  if (near.empty()) return;
  std::sort(near.begin(), near.end());
  const FacePlane plane(f);
  const Polygon window = outline(f, plane);
  const double least = 1e-12 * std::abs(twice_area(window));
  for (const Index other : near) {
    const SurfaceFace& o = second.face(other);
    const bool one_body = &first.body() == &second.body();
    if (one_body && are_neighbours(f, o)) continue;
    const FacePlane opposite(o);
    const double cosine = plane.normal.dot(opposite.normal);
    if (cosine > kFacing) continue;
    // In front of the face by at most the reach, or through it by at most its own size.
    const double height = plane.normal.dot(opposite.origin - plane.origin);
    if (height > reach + o.size || height < -std::max(f.size, o.size)) continue;
    Polygon shape = outline(o, plane);
    std::reverse(shape.begin(), shape.end());  // it looks the other way
    const Polygon segment = common(std::move(shape), window);
    if (segment.size() < 3 || twice_area(segment) <= least) continue;
    Vec2 middle = Vec2::Zero();
    for (const Vec2& x : segment) middle += x / static_cast<double>(segment.size());
    if (one_body && lies_behind(f, o, plane, middle)) continue;
    for (std::size_t k = 0; k < segment.size(); ++k)
      add_triangle(f, plane, {middle, segment[k], segment[(k + 1) % segment.size()]}, {{face, {}}, 0, other}, out);
  }
}

}  // namespace espalier::dynamics::contact

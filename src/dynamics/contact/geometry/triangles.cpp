#include "dynamics/contact/geometry/triangles.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>

#include "base/at.hpp"

namespace espalier::dynamics::contact {

namespace {

std::size_t place_of(Index i) { return at(i); }

/// One index for all points that coincide, in the order of their first appearance.
std::vector<Index> merged_points(std::vector<Vec3>& points) {
  std::map<std::array<double, 3>, Index> known;
  std::vector<Index> renamed;
  std::vector<Vec3> kept;
  for (const Vec3& p : points) {
    if (!p.allFinite()) throw std::invalid_argument("a corner of its triangles is no number");
    const auto [it, fresh] = known.emplace(std::array{p[0], p[1], p[2]}, static_cast<Index>(kept.size()));
    if (fresh) kept.push_back(p);
    renamed.push_back(it->second);
  }
  points = std::move(kept);
  return renamed;
}

/// The point of a triangle nearest to x: which corner (0 to 2), side (3 to 5) or the inside (6) it lies on.
/// C. Ericson, Real-Time Collision Detection (2005), 5.1.5.
struct OnTriangle {
  Vec3 point;
  int where;
};
OnTriangle nearest_on_triangle(const Vec3& x, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 ab = b - a, ac = c - a, ax = x - a;
  const double d1 = ab.dot(ax), d2 = ac.dot(ax);
  if (d1 <= 0 && d2 <= 0) return {a, 0};
  const Vec3 bx = x - b;
  const double d3 = ab.dot(bx), d4 = ac.dot(bx);
  if (d3 >= 0 && d4 <= d3) return {b, 1};
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return {a + d1 / (d1 - d3) * ab, 3};
  const Vec3 cx = x - c;
  const double d5 = ab.dot(cx), d6 = ac.dot(cx);
  if (d6 >= 0 && d5 <= d6) return {c, 2};
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return {a + d2 / (d2 - d6) * ac, 5};
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) return {b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b), 4};
  const double sum = va + vb + vc;
  return {a + vb / sum * ab + vc / sum * ac, 6};
}

}  // namespace

TriangleSurface::TriangleSurface(std::vector<Vec3> points, const std::vector<std::array<Index, 3>>& triangles)
    : points_(std::move(points)) {
  const std::vector<Index> renamed = merged_points(points_);
  double volume = 0;
  for (const auto& t : triangles) {
    std::array<Index, 3> own{};
    for (std::size_t k = 0; k < 3; ++k) {
      if (t[k] < 0 || place_of(t[k]) >= renamed.size())
        throw std::invalid_argument(fmt::format("a triangle names the point {}, of {}", t[k] + 1, renamed.size()));
      own[k] = renamed[place_of(t[k])];
    }
    const Vec3 &a = points_[place_of(own[0])], &b = points_[place_of(own[1])], &c = points_[place_of(own[2])];
    const Vec3 twice = (b - a).cross(c - a);
    const double longest = std::max({(b - a).squaredNorm(), (c - a).squaredNorm(), (c - b).squaredNorm()});
    if (!(twice.norm() > 1e-12 * longest)) continue;  // a needle without area
    volume += a.dot(b.cross(c)) / 6;
    triangles_.push_back(own);
    normals_.push_back(twice.normalized());
  }
  if (triangles_.empty()) throw std::invalid_argument("the surface is empty: it has no triangles with an area");
  find_edges();
  if (closed_ && volume < 0)
    throw std::invalid_argument("the normals of the surface look inwards; reverse the order of its triangles' corners");
  make_trees();
}

void TriangleSurface::find_edges() {
  std::map<std::pair<Index, Index>, Index> known;
  sides_.resize(triangles_.size());
  fans_.assign(points_.size(), 0);
  bool twisted = false;
  for (std::size_t t = 0; t < triangles_.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Index a = triangles_[t][k], b = triangles_[t][(k + 1) % 3];
      ++fans_[place_of(a)];
      const auto [it, fresh] = known.emplace(std::minmax(a, b), static_cast<Index>(edges_.size()));
      sides_[t][k] = it->second;
      if (fresh) {
        edges_.push_back({a, b, static_cast<Index>(t), -1, true});
        continue;
      }
      Edge& edge = edges_[place_of(it->second)];
      if (edge.right >= 0) throw std::invalid_argument("more than two triangles share an edge of the surface");
      twisted = twisted || edge.a == a;
      edge.right = static_cast<Index>(t);
    }
  }
  if (twisted) throw std::invalid_argument("neighbouring triangles of the surface look to different sides");
  closed_ = true;
  constexpr double kFlat = 1e-9;
  for (std::size_t e = 0; e < edges_.size(); ++e) {
    Edge& edge = edges_[e];
    if (edge.right < 0) {
      closed_ = false;
    } else {
      const Vec3 along = points_[place_of(edge.b)] - points_[place_of(edge.a)];
      edge.ridge = normal(edge.left).cross(normal(edge.right)).dot(along) > kFlat * along.norm();
    }
    if (edge.ridge) ridges_.push_back(static_cast<Index>(e));
  }
}

void TriangleSurface::make_trees() {
  std::vector<Box> boxes;
  const auto box_of = [&](auto... corners) {
    Box box;
    (box.add(points_[place_of(corners)]), ...);
    return box;
  };
  for (const auto& t : triangles_) boxes.push_back(box_of(t[0], t[1], t[2]));
  tree_.build(boxes);
  boxes.clear();
  for (const Index e : ridges_) boxes.push_back(box_of(edges_[place_of(e)].a, edges_[place_of(e)].b));
  edge_tree_.build(boxes);
  boxes.clear();
  for (std::size_t p = 0; p < points_.size(); ++p) boxes.push_back(box_of(static_cast<Index>(p)));
  point_tree_.build(boxes);
  const Vec3 extent = tree_.all().high - tree_.all().low;
  extent_ = extent.maxCoeff();
  constexpr double kThin = 1e-3;  // of an open surface that is flat
  depth_ = 0.25 * std::max(extent.minCoeff(), kThin * extent_);
}

void TriangleSurface::add_hit(const Vec3& x, Index triangle, double bound, std::vector<Hit>& hits) const {
  const auto& corners = triangles_[place_of(triangle)];
  const OnTriangle on = nearest_on_triangle(x, points_[place_of(corners[0])], points_[place_of(corners[1])],
                                            points_[place_of(corners[2])]);
  const double distance = (x - on.point).norm();
  if (distance > bound) return;
  using Kind = Near::Kind;
  const Kind kind = on.where == 6 ? Kind::face : on.where < 3 ? Kind::vertex : Kind::edge;
  const Index id = kind == Kind::face     ? triangle
                   : kind == Kind::vertex ? corners[place_of(on.where)]
                                          : sides_[place_of(triangle)][place_of(on.where - 3)];
  hits.push_back({kind, id, on.point, distance});
}

// Edges and corners count where all triangles beside them have found them.
void TriangleSurface::add_near(const Vec3& x, std::vector<Hit>& hits, std::vector<Near>& out) const {
  using Kind = Near::Kind;
  std::stable_sort(hits.begin(), hits.end(),
                   [](const Hit& a, const Hit& b) { return std::pair(a.kind, a.id) < std::pair(b.kind, b.id); });
  for (std::size_t k = 0; k < hits.size();) {
    const Hit& hit = hits[k];
    std::size_t end = k + 1;
    while (end < hits.size() && hits[end].kind == hit.kind && hits[end].id == hit.id) ++end;
    const auto times = static_cast<Index>(end - k);
    k = end;
    if (hit.kind == Kind::face) {
      const double above = normal(hit.id).dot(x - points_[place_of(triangles_[place_of(hit.id)][0])]);
      out.push_back({hit.kind, hit.id, hit.point, above});
      continue;
    }
    const Index beside = hit.kind == Kind::vertex             ? fans_[place_of(hit.id)]
                         : edges_[place_of(hit.id)].right < 0 ? 1
                                                              : 2;
    if (times == beside) out.push_back({hit.kind, hit.id, hits[end - 1].point, hits[end - 1].distance});
  }
}

void TriangleSurface::near(const Vec3& x, double reach, bool only_nearest, std::vector<Near>& out) const {
  thread_local std::vector<Hit> hits;
  hits.clear();
  const std::size_t first = out.size();
  if (only_nearest) {
    // Triangles that share the nearest edge or corner see it at the same distance but for rounding.
    constexpr double kRounding = 1e-12;
    const double slack = kRounding * (x.cwiseAbs().maxCoeff() + extent_);
    double bound = reach;
    tree_.nearest(x, bound, [&](Index t) {
      const std::size_t before = hits.size();
      add_hit(x, t, bound, hits);
      if (hits.size() > before) bound = std::min(bound, hits.back().distance + slack);
    });
    if (hits.empty()) return;
    add_near(x, hits, out);
  }
  // Where rounding hides the nearest one from one of its triangles, the next one counts.
  if (out.size() == first) {
    hits.clear();
    Box around;
    around.add(x);
    around.widen(reach);
    tree_.query(around, [&](Index t) { add_hit(x, t, reach, hits); });
    add_near(x, hits, out);
  }
  const auto begin = out.begin() + static_cast<std::ptrdiff_t>(first);
  std::sort(begin, out.end(), [](const Near& a, const Near& b) {
    const double da = std::abs(a.distance), db = std::abs(b.distance);
    return da < db || (da == db && std::pair(a.kind, a.id) < std::pair(b.kind, b.id));
  });
  if (only_nearest && out.size() > first + 1) out.resize(first + 1);
}

}  // namespace espalier::dynamics::contact

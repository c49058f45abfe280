// Two boxes.
#include <cmath>
#include <limits>

#include "dynamics/contact/geometry/narrow.hpp"

namespace espalier::dynamics::contact {
namespace {

/// The axis along which two boxes overlap least.
struct Separation {
  double gap = -std::numeric_limits<double>::infinity();
  Vec3 normal = Vec3::Zero();  ///< from A to B
  int kind = -1;  ///< 0 to 2: faces of A, 3 to 5: of B, 6 to 14: edge of A (k - 6) / 3 on edge (k - 6) % 3 of B
};

class BoxPair {
 public:
  BoxPair(const PlacedShape& a, const PlacedShape& b)
      : a_(a), b_(b), half_a_(std::get<BoxShape>(*a.shape).half), half_b_(std::get<BoxShape>(*b.shape).half) {}

  [[nodiscard]] Separation separation() const {
    Separation best;
    for (int k = 0; k < 3; ++k) consider(a_.axes.col(k), k, 0, best);
    for (int k = 0; k < 3; ++k) consider(b_.axes.col(k), 3 + k, 0, best);
    // Edges only where they are clearly better: flat faces would otherwise find edges that are nearly parallel.
    const double clearly = 1e-3 * std::min(half_a_.minCoeff(), half_b_.minCoeff());
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        const Vec3 n = a_.axes.col(i).cross(b_.axes.col(j));
        constexpr double kNearlyParallel = 0.05;
        if (n.norm() > kNearlyParallel) consider(n.normalized(), 6 + 3 * i + j, clearly, best);
      }
    return best;
  }

  void edges(const Separation& s, std::vector<Touch>& out) const {
    const int i = (s.kind - 6) / 3, j = (s.kind - 6) % 3;
    Touch touch;
    touch.normal = s.normal;
    touch.gap = s.gap;
    touch.id = touch_id(5, s.kind, 0);
    touch.first.dimension = touch.second.dimension = 1;
    touch.first.along = a_.axes.col(i);
    touch.second.along = b_.axes.col(j);
    const Vec3 pa = support(a_, half_a_, s.normal, i), pb = support(b_, half_b_, -s.normal, j);
    const double cosine = touch.first.along.dot(touch.second.along), sine2 = 1 - cosine * cosine;
    const Vec3 between = pb - pa;
    const double da = touch.first.along.dot(between), db = touch.second.along.dot(between);
    touch.first.point = pa + (da - cosine * db) / sine2 * touch.first.along;
    touch.second.point = pb + (cosine * da - db) / sine2 * touch.second.along;
    out.push_back(touch);
  }

  /// Corners of the lower face of one box, cut off where the face of the other one ends.
  void faces(const Separation& s, double reach, std::vector<Touch>& out) const {
    const bool of_a = s.kind < 3;
    const PlacedShape &face = of_a ? a_ : b_, &other = of_a ? b_ : a_;
    const Vec3 half = of_a ? half_a_ : half_b_, half_other = of_a ? half_b_ : half_a_;
    const Vec3 n = of_a ? s.normal : Vec3(-s.normal);  // out of the face
    const int axis = s.kind % 3;
    std::vector<Vec3> polygon = opposite_face(other, half_other, n);
    for (Vec3& x : polygon) x = face.to_own(x);
    for (int side = 1; side <= 2; ++side) {
      const int k = (axis + side) % 3;
      clip(polygon, k, 1, half[k]);
      clip(polygon, k, -1, half[k]);
    }
    const double sign = n.dot(face.axes.col(axis)) > 0 ? 1 : -1;
    for (std::size_t k = 0; k < polygon.size(); ++k) {
      Touch touch;
      touch.flipped = !of_a;
      touch.normal = n;
      touch.gap = sign * polygon[k][axis] - half[axis];
      if (!(touch.gap < reach)) continue;
      touch.second.point = face.to_global(polygon[k]);
      touch.first.dimension = 2;
      touch.first.point = touch.second.point - touch.gap * n;
      touch.id = touch_id(6, s.kind * 2 + (sign > 0 ? 1 : 0), static_cast<Index>(k));
      out.push_back(touch);
    }
  }

 private:
  void consider(const Vec3& axis, int kind, double handicap, Separation& best) const {
    const Vec3 between = b_.origin - a_.origin;
    const Vec3 n = axis.dot(between) < 0 ? Vec3(-axis) : axis;
    const double reach_a = (a_.axes.transpose() * n).cwiseAbs().dot(half_a_);
    const double reach_b = (b_.axes.transpose() * n).cwiseAbs().dot(half_b_);
    const double gap = n.dot(between) - reach_a - reach_b;
    // Faces of equal depth: the first one, whatever rounding says.
    const double rounding = 1e-9 * (reach_a + reach_b);
    if (gap - handicap > best.gap + (best.kind < 0 ? 0 : rounding)) best = {gap, n, kind};
  }

  /// Middle of the edge along `free` that reaches farthest in direction n.
  static Vec3 support(const PlacedShape& box, const Vec3& half, const Vec3& n, int free) {
    Vec3 own = box.axes.transpose() * n;
    for (int k = 0; k < 3; ++k) own[k] = k == free ? 0 : std::copysign(half[k], own[k]);
    return box.to_global(own);
  }

  static std::vector<Vec3> opposite_face(const PlacedShape& box, const Vec3& half, const Vec3& n) {
    const Vec3 own = box.axes.transpose() * n;
    Eigen::Index axis = 0;
    own.cwiseAbs().maxCoeff(&axis);
    const Eigen::Index i = (axis + 1) % 3, j = (axis + 2) % 3;
    std::vector<Vec3> corners;
    for (const auto& [si, sj] : {std::pair{-1, -1}, {1, -1}, {1, 1}, {-1, 1}}) {
      Vec3 x;
      x[axis] = -std::copysign(half[axis], own[axis]);
      x[i] = si * half[i];
      x[j] = sj * half[j];
      corners.push_back(box.to_global(x));
    }
    return corners;
  }

  /// What of a polygon lies within sign * x[axis] <= limit (Sutherland and Hodgman, CACM 17 (1974)).
  static void clip(std::vector<Vec3>& polygon, int axis, double sign, double limit) {
    std::vector<Vec3> kept;
    for (std::size_t k = 0; k < polygon.size(); ++k) {
      const Vec3 &x = polygon[k], &y = polygon[(k + 1) % polygon.size()];
      const double dx = sign * x[axis] - limit, dy = sign * y[axis] - limit;
      if (dx <= 0) kept.push_back(x);
      if ((dx < 0 && dy > 0) || (dx > 0 && dy < 0)) kept.push_back(x + dx / (dx - dy) * (y - x));
    }
    polygon = std::move(kept);
  }

  const PlacedShape &a_, &b_;
  Vec3 half_a_, half_b_;
};

}  // namespace

void touch_boxes(const PlacedShape& a, const PlacedShape& b, double reach, std::vector<Touch>& out) {
  const BoxPair pair(a, b);
  const Separation s = pair.separation();
  if (!(s.gap < reach)) return;
  if (s.kind >= 6) return pair.edges(s, out);
  pair.faces(s, reach, out);
}

}  // namespace espalier::dynamics::contact

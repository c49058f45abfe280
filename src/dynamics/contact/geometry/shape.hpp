/// \file
/// Rigid shapes that touch each other.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "dynamics/contact/geometry/triangles.hpp"

namespace espalier::dynamics::contact {

/// The half space below z = 0.
struct PlaneShape {};
/// About the origin.
struct SphereShape {
  double radius = 0;
};
/// What is within `radius` of the segment from -half_length to half_length on z.
struct CapsuleShape {
  double radius = 0, half_length = 0;
};
/// With flat ends; axis z.
struct CylinderShape {
  double radius = 0, half_length = 0;
};
struct BoxShape {
  Vec3 half;  ///< half its edges
};
struct MeshShape {
  std::shared_ptr<const TriangleSurface> surface;
};
using Shape = std::variant<PlaneShape, SphereShape, CapsuleShape, CylinderShape, BoxShape, MeshShape>;

/// @throws std::invalid_argument where a length is not positive or no number, or a mesh is missing
void check_shape(const Shape& shape);

/// A shape at a place. Columns of `axes`: its axes in global components.
struct PlacedShape {
  const Shape* shape = nullptr;
  Vec3 origin = Vec3::Zero();
  Mat3 axes = Mat3::Identity();
  [[nodiscard]] Vec3 to_global(const Vec3& x) const { return origin + axes * x; }
  [[nodiscard]] Vec3 to_own(const Vec3& x) const { return axes.transpose() * (x - origin); }
  [[nodiscard]] Vec3 z() const { return axes.col(2); }
};

/// The box around it in global axes. Not of planes, which have none.
[[nodiscard]] Box box_around(const PlacedShape& placed);
/// Its smallest extent (a radius, half an edge), a length by which depths are measured; planes: infinite.
[[nodiscard]] double least_extent(const Shape& shape);

/// What of a surface is touched: a point, a line or a circle on it, or a plane, with a layer of thickness `radius`
/// around. All in global components.
struct Feature {
  int dimension = 0;              ///< 0 point, 1 curve, 2 plane
  Vec3 point = Vec3::Zero();      ///< on it, at the place of contact
  Vec3 along = Vec3::Zero();      ///< unit tangent of a curve
  Vec3 curvature = Vec3::Zero();  ///< derivative of the tangent by the length of the curve
  double radius = 0;
};

/// Two features next to each other, `first` on one body and `second` on the other.
struct Touch {
  std::uint64_t id = 0;  ///< of the features, within the pair of shapes; see touch_group()
  bool flipped = false;  ///< `first` belongs to shape B
  Feature first, second;
  Vec3 normal = Vec3::Zero();  ///< unit; from first to second
  double gap = 0;              ///< negative: they overlap
  bool at_second = false;      ///< the forces act at second.point, not in the middle of gap or overlap
  /// From the centre of what is round of the second feature to where it touches.
  [[nodiscard]] Vec3 arm() const {
    if (at_second) return Vec3::Zero();
    const double bend = second.curvature.squaredNorm();
    return -second.radius * normal - (bend > 0 ? Vec3(second.curvature / bend) : Vec3(Vec3::Zero()));
  }
  /// How far behind second.point they act, against the normal.
  [[nodiscard]] double behind() const { return at_second ? 0 : second.radius + 0.5 * gap; }
};

/// All touches of two shapes with gaps below `reach`, in a fixed order. The same features have the same id as long as
/// they touch.
void find_touches(const PlacedShape& a, const PlacedShape& b, double reach, std::vector<Touch>& out);

/// What ids of touches have in common whose point or edge has moved on to another face of the other shape.
[[nodiscard]] constexpr std::uint64_t touch_group(std::uint64_t id) { return id >> 32U; }

/// Whether find_touches() knows the pair: planes do not touch planes.
[[nodiscard]] bool can_touch(const Shape& a, const Shape& b);

}  // namespace espalier::dynamics::contact

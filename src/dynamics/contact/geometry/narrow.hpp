/// \file
/// Pieces of the narrow phase: corners and edges of shapes, and what of a shape lies next to a point.
#pragma once

#include "dynamics/contact/geometry/shape.hpp"

namespace espalier::dynamics::contact {

/// A point with a layer around: the corner of a shape.
struct Corner {
  Index id = 0;
  Vec3 point;
  double radius = 0;
  bool alone = false;  ///< touches only what is nearest to it
};
/// A segment with a layer around. Sharp edges know the normals of the faces beside them.
struct EdgeLine {
  Index id = 0;
  Vec3 middle, along;  ///< along: unit
  double half = 0, radius = 0;
  Vec3 left = Vec3::Zero(), right = Vec3::Zero();  ///< (left x right) . along > 0; zero where the edge is round
};

/// What of a shape may touch another one, in the axes of the first: a box and, where the other one is round, the
/// distance from its axis.
struct Vicinity {
  Box box;  ///< empty: everywhere
  Vec3 origin = Vec3::Zero(), axis = Vec3::Zero();
  double radius = std::numeric_limits<double>::infinity();  ///< around the line through the origin along the axis; a
                                                            ///< sphere has no axis
  [[nodiscard]] bool holds(const Vec3& x) const;
  /// Whether a segment from a to b may reach the axis, at an angle at which edges touch.
  [[nodiscard]] bool meets_segment(const Vec3& a, const Vec3& b) const;
};

/// Corners (edges) of a shape that its vicinity holds; all where it has few. Cylinders: points on the rims.
[[nodiscard]] std::vector<Corner> corners_of(const PlacedShape& shape, const Vicinity& within);
[[nodiscard]] std::vector<EdgeLine> edges_of(const PlacedShape& shape, const Vicinity& within);

/// Adds what of `shape` lies next to the corner of another one, with gaps below `reach`; the corner is `second`.
void touch_corner(const PlacedShape& shape, const Corner& corner, double reach, std::vector<Touch>& out);

/// Two boxes: corners and edges on the face, or the edge on the edge, along the axis of least depth (separating axes:
/// Gottschalk, Lin, Manocha, SIGGRAPH 1996).
void touch_boxes(const PlacedShape& a, const PlacedShape& b, double reach, std::vector<Touch>& out);

/// An id: kind of the touch, number of the corner or edge, number on the other shape.
[[nodiscard]] constexpr std::uint64_t touch_id(unsigned kind, Index own, Index other) {
  return static_cast<std::uint64_t>(kind) << 60U | static_cast<std::uint64_t>(own) << 32U |
         static_cast<std::uint64_t>(other);
}

}  // namespace espalier::dynamics::contact

/// \file
/// Where the forces between surfaces of solids are integrated.
#pragma once

#include <vector>

#include "dynamics/contact/face_touch.hpp"

namespace espalier::dynamics::contact {

/// A point of integration on the first surface.
struct ContactPoint {
  FaceSpot spot;
  double weight = 0;    ///< area without stress; length of a line
  Index opposite = -1;  ///< the face of the second surface that was opposite to it when it was made; -1: a rigid shape,
                        ///< or a point of a line, which looks for what is opposite each time
};

/// Cosine between the normals of faces that look at each other, at most.
inline constexpr double kFacing = -0.2;

/// The points of a face against rigid shapes: those of a rule for pressure in each of its divisions; of a line against
/// anything: Lobatto's five points (degree seven, with both ends) in each division of the element.
/// @param radius  of a round shape, which does not pass between points: a face that is larger than it is divided so
/// that they are about half of it apart; infinite: none
void points_of_face(const FaceSurface& surface, Index face, double radius, std::vector<ContactPoint>& out);
/// How many points a face would have.
[[nodiscard]] double count_of_points(const FaceSurface& surface, Index face, double radius);

/// The points of a face of the first surface against those faces of the second one that look at it from within `reach`:
/// both are put on the plane of the face, cut into common polygons (mortar segments; Puso and Laursen, Comput. Methods
/// Appl. Mech. Engrg. 193 (2004)) and these into triangles with a rule of degree five. On flat surfaces of affine faces
/// (triangles with straight sides, parallelograms) both sides are integrated exactly.
void points_of_segments(const FaceSurface& first, Index face, FaceSurface& second, double reach,
                        std::vector<ContactPoint>& out);

}  // namespace espalier::dynamics::contact

/// \file
/// What rolls on a plane, or glides on it along an edge: the relative coordinates of the place of contact.
#pragma once

#include "dynamics/joints/relative.hpp"

namespace espalier::dynamics {

/// A circle about the z axis of frame B with a round rim (a torus), on the plane z = 0 of frame A, which lies on the
/// side of z: a thin disc without `rim`, a tyre with one, a ball without `radius`. An edge (skate): the point
/// itself, which glides along the x axis of frame B.
struct RollingShape {
  double radius = 0;  ///< of the circle
  double rim = 0;     ///< radius of the rim's section
  bool edge = false;
  /// Whether it has directions of its own; a ball takes the axes of the plane.
  [[nodiscard]] bool directed() const { return edge || radius > 0; }
};

/// Directions at the place of contact. Longitudinal: where a wheel rolls to with a positive turn about z_B, seen from
/// its side, z_B x n; lateral: n x longitudinal; normal: n = z_A.
enum class RollingDirection { longitudinal, lateral, normal };

/// As for a relative coordinate: c w is the velocity of B's material point of contact against A's, in the direction.
/// The value is the height above the plane, and 0 of the other directions, which are known by velocities alone.
/// @throws espalier::Error where the wheel lies flat on the plane, or the edge stands upright
void evaluate(const RollingShape& shape, RollingDirection direction, const FrameMotion& a, const FrameMotion& b,
              bool rates, RelativeValue& out);
void add_curvature(const RollingShape& shape, RollingDirection direction, const FrameMotion& a, const FrameMotion& b,
                   double factor, Mat12& k);
/// The place of contact, global axes.
[[nodiscard]] Vec3 rolling_contact(const RollingShape& shape, const FrameMotion& a, const FrameMotion& b);

}  // namespace espalier::dynamics

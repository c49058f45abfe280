/// \file
/// Surfaces on which a point stays: known by a function of its place that is zero on them.
#pragma once

#include "dynamics/joints/joint.hpp"

namespace espalier::dynamics {

using SurfacePtr = std::shared_ptr<const PointFunction>;

// In the axes of the frame that carries them.
[[nodiscard]] SurfacePtr sphere_surface(double radius);
/// z = 0
[[nodiscard]] SurfacePtr plane_surface();
/// Half axes along x, y, z.
[[nodiscard]] SurfacePtr ellipsoid_surface(const Vec3& axes);
/// About z.
[[nodiscard]] SurfacePtr cylinder_surface(double radius);
/// About z, open towards it, with its apex at the origin; the angle between axis and surface.
[[nodiscard]] SurfacePtr cone_surface(double angle);
/// About z: a tube of radius `rim` along a circle.
[[nodiscard]] SurfacePtr torus_surface(double radius, double rim);
/// z = f(x, y), the bicubic spline through heights at the points of a grid: heights[i][j] at (x_i, y_j), both rising.
/// At its edges it goes on straight.
[[nodiscard]] SurfacePtr height_surface(std::vector<double> x, std::vector<double> y,
                                        std::vector<std::vector<double>> heights);

/// The origin of B stays on a surface in frame A.
[[nodiscard]] std::unique_ptr<Joint> point_on_surface(std::string name, FramePtr a, FramePtr b, SurfacePtr surface);

}  // namespace espalier::dynamics

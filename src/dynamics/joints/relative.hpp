/// \file
/// Relative coordinates of two frames: the scalar functions that all joints, motors and springs are made of.
#pragma once

#include <array>

#include "dynamics/dae/frame.hpp"

namespace espalier::dynamics {

using Mat12 = Eigen::Matrix<double, 12, 12>;
using Row12 = std::array<double, 12>;

/// The functions. d = r_B - r_A; x, y, z with index A or B: axes of the frames.
enum class Relative {
  global,    ///< d . e_i, e_i the i-th global axis
  along,     ///< d . a_i, a_i the i-th axis of frame A
  dot,       ///< a_i . b_j
  distance,  ///< |d|
  angle,     ///< angle about z_A from x_A to b_j (the part of b_j in the plane), in (-pi, pi]; j = 0: x_B
  polar,     ///< angle about z_A from x_A to d, likewise: where the origin of B stands round the axis of A
  bend,      ///< angle between z_A and z_B, in [0, pi]; without a gradient where they are parallel, and zero is taken
};
/// Known up to whole turns.
[[nodiscard]] constexpr bool is_angle(Relative kind) { return kind == Relative::angle || kind == Relative::polar; }

/// Value, gradient and rate part of a relative coordinate g. The gradient belongs to the twist increments
/// [dr_A, dphi_A, dr_B, dphi_B] (global axes); g' = c w and g'' = c w' + curvature, w the twists.
struct RelativeValue {
  double value = 0;
  Row12 c{};
  double curvature = 0;  ///< (dc/dt) w
};

/// Evaluates value and gradient, and the curvature where the motions contain velocities.
/// @throws espalier::Error where the function has no gradient (distance zero, axis perpendicular for `angle`, origin of
/// B on the axis for `polar`)
void evaluate(Relative kind, int i, int j, const FrameMotion& a, const FrameMotion& b, bool rates, RelativeValue& out);

/// k += factor * dc/d[dr_A, dphi_A, dr_B, dphi_B] (row: entry of c; not symmetric, because rotations do not commute).
void add_curvature(Relative kind, int i, int j, const FrameMotion& a, const FrameMotion& b, double factor, Mat12& k);

/// True if dc/dx has parts that belong to translations.
[[nodiscard]] bool curves_in_translation(Relative kind);

}  // namespace espalier::dynamics

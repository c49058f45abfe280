/// \file
/// Rotations in three dimensions: unit quaternions, rotation vectors, and the tangent operators between them.
#pragma once

#include "dynamics/dae/frame.hpp"

namespace espalier::dynamics {

/// A unit quaternion [w, x, y, z]; R x = q x q*.
using Quat = Eigen::Vector4d;

/// x~, with x~ y = x cross y.
[[nodiscard]] inline Mat3 skew(const Vec3& x) {
  Mat3 m;
  m << 0, -x.z(), x.y(), x.z(), 0, -x.x(), -x.y(), x.x(), 0;
  return m;
}

[[nodiscard]] Quat multiply(const Quat& a, const Quat& b);
/// R^T x
[[nodiscard]] inline Vec3 turned_back(const Quat& q, const Vec3& x) {
  const Vec3 axis = q.tail<3>(), twice = 2 * axis.cross(x);
  return x - q[0] * twice + axis.cross(twice);
}
/// Quaternion of the rotation vector x (angle |x| about x); no singular angle.
[[nodiscard]] Quat quaternion_exp(const Vec3& x);
/// Rotation vector of a unit quaternion, of length at most pi; +-q give the same.
[[nodiscard]] Vec3 quaternion_log(const Quat& q);
[[nodiscard]] inline Mat3 rotation_matrix(const Quat& q) {
  const double w = q[0], x = q[1], y = q[2], z = q[3];
  Mat3 r;
  r << 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), 2 * (x * y + w * z), 1 - 2 * (x * x + z * z),
      2 * (y * z - w * x), 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y);
  return r;
}
/// Quaternion of a rotation matrix (Shepperd's choice of the largest component).
[[nodiscard]] Quat quaternion_of(const Mat3& r);
[[nodiscard]] Mat3 rotation_exp(const Vec3& x);
[[nodiscard]] Vec3 rotation_log(const Mat3& r);

/// Body angular velocity of R0 exp(x~(t)): omega = T(x) x_dot,
/// T = I - (1 - cos x)/x^2 x~ + (x - sin x)/x^3 x~^2 (series below 1e-2).
[[nodiscard]] Vec3 tangent_times(const Vec3& x, const Vec3& x_dot);

/// A^T(x) u where A is the inverse of the left tangent operator: delta x = A(x) delta for exp(delta~) exp(x~) = exp(x~
/// + dx~). A^T u = u + x cross u / 2 + g x cross (x cross u), g = 1/x^2 - cot(x/2)/(2 x). A^T = T^-1.
[[nodiscard]] Vec3 inverse_tangent_transposed_times(const Vec3& x, const Vec3& u);
/// A(x) as a matrix.
[[nodiscard]] Mat3 inverse_left_tangent(const Vec3& x);
/// Derivative of A^T(x) u with respect to x, u held constant.
[[nodiscard]] Mat3 inverse_tangent_transposed_derivative(const Vec3& x, const Vec3& u);

}  // namespace espalier::dynamics

/// \file
/// A place with axes.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "dense/dense.hpp"

namespace espalier::dynamics::model::robots {

using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;

/// Maps x in its axes to p + r x in those around it.
struct Pose {
  Vec3 p = Vec3::Zero();
  Mat3 r = Mat3::Identity();
  [[nodiscard]] Pose operator*(const Pose& inner) const { return {p + r * inner.p, r * inner.r}; }
  [[nodiscard]] Vec3 operator*(const Vec3& x) const { return p + r * x; }
  [[nodiscard]] Pose inverse() const { return {-(r.transpose() * p), r.transpose()}; }
};

[[nodiscard]] inline Mat3 about(const Vec3& axis, double angle) {
  return Eigen::AngleAxisd(angle, axis).toRotationMatrix();
}
/// @pre the quaternion [w, x, y, z] is not zero
[[nodiscard]] inline Mat3 of_quaternion(double w, double x, double y, double z) {
  return Eigen::Quaterniond(w, x, y, z).normalized().toRotationMatrix();
}
/// The least turn that brings z to a direction. @pre it is not zero
[[nodiscard]] inline Mat3 z_along(const Vec3& direction) { return dense::rotation_between(Vec3::UnitZ(), direction); }

}  // namespace espalier::dynamics::model::robots

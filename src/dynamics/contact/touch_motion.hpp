/// \file
/// How gap, normal and place of a touch change when its two bodies move.
#pragma once

#include "dynamics/bodies/rotation.hpp"
#include "dynamics/contact/geometry/shape.hpp"
#include "dynamics/contact/law.hpp"

namespace espalier::dynamics::contact {

using Vec12 = Eigen::Matrix<double, 12, 1>;
using Mat12 = Eigen::Matrix<double, 12, 12>;
using Mat3x12 = Eigen::Matrix<double, 3, 12>;

/// The motion of a body, in global components.
struct BodyMotion {
  Vec3 origin = Vec3::Zero();  ///< of moments and of the twist
  Mat3 axes = Mat3::Identity();
  Vec3 velocity = Vec3::Zero(), omega = Vec3::Zero();
  [[nodiscard]] Vec3 to_global(const Vec3& own) const { return origin + axes * own; }
  [[nodiscard]] Vec3 to_own(const Vec3& x) const { return axes.transpose() * (x - origin); }
  [[nodiscard]] Vec3 velocity_at(const Vec3& x) const { return velocity + omega.cross(x - origin); }
};

/// Derivatives by the increments [u_A, phi_A, u_B, phi_B] of positions of the origins and rotations, global axes.
struct TouchMotion {
  Vec3 normal;  ///< from A to B
  Vec3 point;   ///< where the forces act
  Vec12 gap = Vec12::Zero();
  Mat3x12 normal_by = Mat3x12::Zero(), point_by = Mat3x12::Zero();
  Mat3x12 arm_by = Mat3x12::Zero();  ///< of Touch::arm()
};

/// First derivatives of what find_touches() gave, features and all: exact as long as the features stay the same.
[[nodiscard]] TouchMotion touch_motion(const Touch& touch, const BodyMotion& a, const BodyMotion& b);

/// Displacement of the point x of B minus that of the point of A which is there too, by the same increments.
[[nodiscard]] Mat3x12 slip_of(const Vec3& x, const BodyMotion& a, const BodyMotion& b);

/// Where the tangential spring began. In the frame of the first feature's body the second body moves with a point of
/// its own (the centre of what is round) and turns about it by theta: the spring is stretched by the displacement of
/// that point and theta x arm, arm from it to where it touches, the mean of now and then. What rolls stretches no
/// spring.
struct SpringEnds {
  Vec3 on_first = Vec3::Zero();   ///< in the axes of the first body
  Vec3 on_second = Vec3::Zero();  ///< in the axes of the second body
  Vec3 arm = Vec3::Zero();        ///< in the axes of the first body
  Mat3 turn = Mat3::Identity();   ///< axes of the second body in those of the first
};
/// The ends of a spring that has the stretch `kept` (on B, global axes).
[[nodiscard]] SpringEnds spring_ends(const Touch& touch, const BodyMotion& a, const BodyMotion& b, const Vec3& kept);

/// What one touch does.
struct TouchForce {
  NormalForce normal;
  FrictionForce friction;  ///< on B
  Vec3 stretch = Vec3::Zero(), slip_rate = Vec3::Zero();
  Vec12 wrench = Vec12::Zero();  ///< [force on A, moment on A, force on B, moment on B] about the origins
};
struct TouchTangent {
  Mat12 by_place = Mat12::Zero();  ///< of the wrench, by the increments, with twists that stay
  Mat12 by_twist = Mat12::Zero();
};

/// @param damping a of the normal force @param ends null: the spring of friction begins here, without stretch
/// @param tangent null: not wanted
[[nodiscard]] TouchForce touch_force(const ContactLaw& law, double damping, const Touch& touch, const BodyMotion& a,
                                     const BodyMotion& b, const SpringEnds* ends, TouchTangent* tangent);

/// Derivative of F = -J^T wrench by coordinates in which bodies turn by increments in their own axes and have angular
/// velocities there: weights.q of the coordinates, weights.v of their rates.
[[nodiscard]] Mat12 coordinate_tangent(const TouchForce& force, const TouchTangent& tangent, double weight_q,
                                       double weight_v, const BodyMotion& a, const BodyMotion& b);

}  // namespace espalier::dynamics::contact

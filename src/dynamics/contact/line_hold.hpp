/// \file
/// Where a spring of friction holds on to a line.
#pragma once

#include "dynamics/contact/face_surface.hpp"
#include "dynamics/contact/law.hpp"

namespace espalier::dynamics::contact {

/// The end of a tangential spring on a line (axis y, tangent t = y,xi): an arm from the axis that turns with the
/// tangent. A line has no turn about its own axis, so this is the smallest rotation that takes the tangent u of then to
/// that of now, v = t / |t| (Rodrigues' formula with w = u x v):
///   R(t) a = a (u . v) + w x a + w (w . a) / (1 + u . v)
struct LineHold {
  Vec3 arm = Vec3::Zero();       ///< from the axis, when it was made
  Vec3 tangent = Vec3::UnitX();  ///< of unit length, when it was made
  /// R(t) a. @pre the tangent has not turned round since (u . v > -1)
  [[nodiscard]] Vec3 arm_at(const Vec3& t) const;
  /// Its derivative by t.
  [[nodiscard]] Mat3 arm_by(const Vec3& t) const;
};

/// How fast the surface of a line passes by below a point at the distance d n from its axis, beside the relative
/// velocity of the point and the axis: what is fixed to the line turns with the angular velocity (t x t') / m, m = t .
/// t, without a turn about t. The point then gains t (t' . d n) / m.
struct LineTurn {
  Vec3 gain = Vec3::Zero();
  Mat3 by_tangent = Mat3::Zero(), by_rate = Mat3::Zero(), by_lever = Mat3::Zero();
};
/// @param t,rate  tangent and its rate @param lever  d n
[[nodiscard]] LineTurn line_turn(const Vec3& t, const Vec3& rate, const Vec3& lever);

}  // namespace espalier::dynamics::contact

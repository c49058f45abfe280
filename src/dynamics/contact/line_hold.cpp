#include "dynamics/contact/line_hold.hpp"

#include "dynamics/bodies/rotation.hpp"

namespace espalier::dynamics::contact {

Vec3 LineHold::arm_at(const Vec3& t) const {
  const Vec3 v = t.normalized(), w = tangent.cross(v);
  const double cosine = tangent.dot(v);
  return arm * cosine + w.cross(arm) + w * (w.dot(arm) / (1 + cosine));
}

Mat3 LineHold::arm_by(const Vec3& t) const {
  const Vec3 v = t.normalized(), w = tangent.cross(v);
  const double more = 1 + tangent.dot(v), along = w.dot(arm);
  const Mat3 w_by = skew(tangent);
  const Mat3 by_v = arm * tangent.transpose() - skew(arm) * w_by +
                    (along * Mat3::Identity() + w * arm.transpose()) * w_by / more -
                    along / (more * more) * w * tangent.transpose();
  return by_v * (Mat3::Identity() - v * v.transpose()) / t.norm();
}

LineTurn line_turn(const Vec3& t, const Vec3& rate, const Vec3& lever) {
  const double m = t.squaredNorm(), across = rate.dot(lever) / m;
  LineTurn turn;
  turn.gain = across * t;
  turn.by_tangent = across * (Mat3::Identity() - 2 / m * t * t.transpose());
  turn.by_rate = t * lever.transpose() / m;
  turn.by_lever = t * rate.transpose() / m;
  return turn;
}

}  // namespace espalier::dynamics::contact

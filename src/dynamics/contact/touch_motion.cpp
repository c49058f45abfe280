#include "dynamics/contact/touch_motion.hpp"

#include <cmath>

namespace espalier::dynamics::contact {
namespace {

using Row12 = Eigen::Matrix<double, 1, 12>;

/// Displacement of a point of one of the bodies: u + phi x (x - origin).
Mat3x12 displacement(const Vec3& x, const BodyMotion& body, bool is_b) {
  Mat3x12 d = Mat3x12::Zero();
  const int at = is_b ? 6 : 0;
  d.block<3, 3>(0, at).setIdentity();
  d.block<3, 3>(0, at + 3) = -skew(x - body.origin);
  return d;
}

Mat3x12 turn_of(bool is_b) {
  Mat3x12 d = Mat3x12::Zero();
  d.block<3, 3>(0, is_b ? 9 : 3).setIdentity();
  return d;
}

/// The two features of a touch with their bodies.
class FeatureMotion {
 public:
  FeatureMotion(const Touch& touch, const BodyMotion& a, const BodyMotion& b)
      : t_(touch),
        first_is_b_(touch.flipped),
        turn_1_(turn_of(touch.flipped)),
        turn_2_(turn_of(!touch.flipped)),
        move_1_(displacement(touch.first.point, touch.flipped ? b : a, touch.flipped)),
        move_2_(displacement(touch.second.point, touch.flipped ? a : b, !touch.flipped)) {}

  [[nodiscard]] TouchMotion motion() {
    if (t_.first.dimension == 2) {
      on_plane();
    } else {
      between_curves();
    }
    const double behind = t_.behind(), half = t_.at_second ? 0 : 0.5;
    TouchMotion m;
    const Row12 gap = t_.normal.transpose() * (move_2_ - move_1_);
    m.gap = gap.transpose();
    m.point = t_.second.point - behind * t_.normal;
    m.point_by = move_2_ + t_.second.along * shift_2_ - half * t_.normal * gap - behind * normal_by_;
    if (!t_.at_second) {
      m.arm_by = -t_.second.radius * normal_by_;
      if (const double bend = t_.second.curvature.squaredNorm(); bend > 0)
        m.arm_by += skew(t_.second.curvature / bend) * turn_2_ + t_.second.along * shift_2_;
    }
    m.normal = first_is_b_ ? Vec3(-t_.normal) : t_.normal;
    m.normal_by = first_is_b_ ? Mat3x12(-normal_by_) : normal_by_;
    return m;
  }

 private:
  // The normal is fixed to the first body; a circle shifts its lowest point: along . n = 0 stays.
  void on_plane() {
    normal_by_ = -skew(t_.normal) * turn_1_;
    if (t_.second.dimension == 0) return;
    const Vec3 &n = t_.normal, &a = t_.second.along;
    const double bend = t_.second.curvature.dot(n);
    if (bend == 0) return;
    const Row12 turned = a.cross(n).transpose() * (turn_2_ - turn_1_);
    shift_2_ = -turned / bend;
  }

  // w = d n from the first to the second point, normal to both curves: with dw = du + b ds_2 - a ds_1
  //   a . w = 0:  phi_1 . (a x w) + k_1 . w ds_1 + a . dw = 0, and the same for b.
  void between_curves() {
    const Feature &f = t_.first, &s = t_.second;
    const Vec3 &n = t_.normal, &a = f.along, &b = s.along;
    const double d = t_.gap + f.radius + s.radius;
    const Mat3x12 du = move_2_ - move_1_;
    const bool curve_1 = f.dimension == 1, curve_2 = s.dimension == 1;
    const double k1 = d * f.curvature.dot(n), k2 = d * s.curvature.dot(n), c = a.dot(b);
    const Row12 r1 = curve_1 ? Row12(a.transpose() * du + d * a.cross(n).transpose() * turn_1_) : Row12::Zero();
    const Row12 r2 = curve_2 ? Row12(b.transpose() * du + d * b.cross(n).transpose() * turn_2_) : Row12::Zero();
    // [k1 - 1, c; -c, k2 + 1] [ds_1; ds_2] = -[r1; r2]
    const double m11 = curve_1 ? k1 - 1 : -1, m22 = curve_2 ? k2 + 1 : 1, m12 = curve_1 && curve_2 ? c : 0;
    const double det = m11 * m22 + m12 * m12;
    if (std::abs(det) > 1e-12) {
      shift_1_ = (-m22 * r1 + m12 * r2) / det;
      shift_2_ = (-m12 * r1 - m11 * r2) / det;
    }
    if (curve_1 && curve_2) {
      // n stays normal to both: a . dn = -phi_1 . (a x n), b . dn = -phi_2 . (b x n)
      const double sine2 = 1 - c * c;
      const Row12 na = -a.cross(n).transpose() * turn_1_ - shift_1_ * f.curvature.dot(n);
      const Row12 nb = -b.cross(n).transpose() * turn_2_ - shift_2_ * s.curvature.dot(n);
      normal_by_ = ((a - c * b) * na + (b - c * a) * nb) / sine2;
    } else if (d > 0) {
      const Mat3x12 dw = du + b * shift_2_ - a * shift_1_;
      normal_by_ = (dw - n * (n.transpose() * dw)) / d;
    }
  }

  const Touch& t_;
  bool first_is_b_;
  Mat3x12 turn_1_, turn_2_, move_1_, move_2_, normal_by_ = Mat3x12::Zero();
  Row12 shift_1_ = Row12::Zero(), shift_2_ = Row12::Zero();
};

/// Derivative of the rotation vector x of R by an increment that turns R from the left (global axes).
Mat3 inverse_left_tangent(const Vec3& x) {
  const double angle = x.norm();
  const double c =
      angle < 1e-2 ? 1.0 / 12 + angle * angle / 720 : (1 - 0.5 * angle / std::tan(0.5 * angle)) / (angle * angle);
  return Mat3::Identity() - 0.5 * skew(x) + c * skew(x) * skew(x);
}

/// The vector that the spring's stretch is the tangential part of, on the second body, and its derivative.
struct Spring {
  Vec3 between;
  Mat3x12 by;
};
Spring spring_of(const Touch& touch, const BodyMotion& a, const BodyMotion& b, const SpringEnds& ends,
                 const TouchMotion* motion) {
  const bool flipped = touch.flipped;
  const BodyMotion &first = flipped ? b : a, &second = flipped ? a : b;
  const Vec3 on_first = first.to_global(ends.on_first), on_second = second.to_global(ends.on_second);
  const Vec3 theta = rotation_log(second.axes * ends.turn.transpose() * first.axes.transpose());
  const Vec3 then = first.axes * ends.arm, arm = 0.5 * (touch.arm() + then);
  Spring spring{on_second - on_first + theta.cross(arm), Mat3x12::Zero()};
  if (motion == nullptr) return spring;
  const Mat3x12 turn_1 = turn_of(flipped), turn_2 = turn_of(!flipped);
  const Mat3 left = inverse_left_tangent(theta);
  spring.by = displacement(on_second, second, !flipped) - displacement(on_first, first, flipped) -
              skew(arm) * (left * turn_2 - left.transpose() * turn_1) +
              0.5 * skew(theta) * (motion->arm_by - skew(then) * turn_1);
  return spring;
}

/// Derivatives of a force on B at a point, and of its moments, from those of the force.
void add_wrench_derivatives(const Vec3& force, const Mat3x12& force_by, const TouchMotion* m, const Vec3& point,
                            const BodyMotion& a, const BodyMotion& b, Mat12& out) {
  out.topRows<3>() -= force_by;
  out.middleRows<3>(6) += force_by;
  out.middleRows<3>(3) -= skew(point - a.origin) * force_by;
  out.middleRows<3>(9) += skew(point - b.origin) * force_by;
  if (m == nullptr) return;
  Mat3x12 arm_a = m->point_by, arm_b = m->point_by;
  arm_a.block<3, 3>(0, 0).diagonal().array() -= 1;
  arm_b.block<3, 3>(0, 6).diagonal().array() -= 1;
  out.middleRows<3>(3) += skew(force) * arm_a;
  out.middleRows<3>(9) -= skew(force) * arm_b;
}

}  // namespace

TouchMotion touch_motion(const Touch& touch, const BodyMotion& a, const BodyMotion& b) {
  return FeatureMotion(touch, a, b).motion();
}

Mat3x12 slip_of(const Vec3& x, const BodyMotion& a, const BodyMotion& b) {
  return displacement(x, b, true) - displacement(x, a, false);
}

SpringEnds spring_ends(const Touch& touch, const BodyMotion& a, const BodyMotion& b, const Vec3& kept) {
  const BodyMotion &first = touch.flipped ? b : a, &second = touch.flipped ? a : b;
  const Vec3 arm = touch.arm(), centre = touch.second.point - touch.behind() * touch.normal - arm;
  const double sign = touch.flipped ? -1 : 1;
  return {first.to_own(centre - sign * kept), second.to_own(centre), first.axes.transpose() * arm,
          first.axes.transpose() * second.axes};
}

TouchForce touch_force(const ContactLaw& law, double damping, const Touch& touch, const BodyMotion& a,
                       const BodyMotion& b, const SpringEnds* ends, TouchTangent* tangent) {
  TouchForce result;
  const double sign = touch.flipped ? -1 : 1;
  const Vec3 n = sign * touch.normal;
  const Vec3 x = touch.second.point - touch.behind() * touch.normal;
  const Vec3 relative = b.velocity_at(x) - a.velocity_at(x);
  const double rate = -n.dot(relative);
  result.normal = normal_force(law, -touch.gap, rate, damping);
  const Mat3 in_plane = Mat3::Identity() - n * n.transpose();
  Vec3 between = Vec3::Zero();
  if (law.rubs()) {
    if (ends != nullptr) between = sign * spring_of(touch, a, b, *ends, nullptr).between;
    result.stretch = in_plane * between;
    result.slip_rate = in_plane * relative;
    result.friction = friction_force(law, result.normal.force, result.stretch, result.slip_rate);
  }
  const Vec3 force = result.normal.force * n + result.friction.force;
  result.wrench << -force, -(x - a.origin).cross(force), force, (x - b.origin).cross(force);
  if (tangent == nullptr) return result;

  const TouchMotion m = touch_motion(touch, a, b);
  // d(velocity of B minus that of A at the point) with the point; the twists stay
  Mat3x12 relative_by = skew(b.omega - a.omega) * m.point_by;
  relative_by.block<3, 3>(0, 0) += skew(a.omega);
  relative_by.block<3, 3>(0, 6) -= skew(b.omega);
  const Mat3x12 relative_by_twist = slip_of(x, a, b);
  const auto rate_by = [&](const Mat3x12& v) { return Row12(-n.transpose() * v); };
  const Row12 n_by_place = -result.normal.by_penetration * m.gap.transpose() +
                           result.normal.by_rate * (rate_by(relative_by) - relative.transpose() * m.normal_by);
  const Row12 n_by_twist = result.normal.by_rate * rate_by(relative_by_twist);
  Mat3x12 by_place = n * n_by_place + result.normal.force * m.normal_by, by_twist = n * n_by_twist;
  if (law.rubs()) {
    const FrictionForce& f = result.friction;
    const auto projected = [&](const Vec3& y, const Mat3x12& y_by) {
      return Mat3x12(in_plane * y_by - n.dot(y) * m.normal_by - n * (y.transpose() * m.normal_by));
    };
    const Mat3x12 slip_rate_by = projected(relative, relative_by);
    Mat3x12 trial = law.tangential_damping * slip_rate_by;
    if (ends != nullptr)
      trial += law.tangential_stiffness * projected(between, sign * spring_of(touch, a, b, *ends, &m).by);
    by_place += f.by_trial * trial + f.by_rate * slip_rate_by + f.by_normal * n_by_place;
    by_twist +=
        (law.tangential_damping * f.by_trial + f.by_rate) * in_plane * relative_by_twist + f.by_normal * n_by_twist;
  }
  add_wrench_derivatives(force, by_place, &m, x, a, b, tangent->by_place);
  add_wrench_derivatives(force, by_twist, nullptr, x, a, b, tangent->by_twist);
  return result;
}

// J = [1, 0; 0, R] for each body: omega = R omega_body turns with its body, and R^T takes the moment there.
Mat12 coordinate_tangent(const TouchForce& force, const TouchTangent& tangent, double weight_q, double weight_v,
                         const BodyMotion& a, const BodyMotion& b) {
  Mat12 k = weight_v * tangent.by_twist, turn = Mat12::Identity();
  if (weight_q != 0) k += weight_q * tangent.by_place;
  for (const int side : {0, 1}) {
    const BodyMotion& m = side == 0 ? a : b;
    const int at = 6 * side + 3;
    if (weight_q != 0) {
      k.middleCols<3>(at) -= weight_q * tangent.by_twist.middleCols<3>(at) * skew(m.omega);
      k.block<3, 3>(at, at) += weight_q * skew(force.wrench.segment<3>(at));
    }
    turn.block<3, 3>(at, at) = m.axes;
  }
  return -(turn.transpose() * k * turn);
}

}  // namespace espalier::dynamics::contact

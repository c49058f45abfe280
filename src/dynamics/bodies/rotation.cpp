#include "dynamics/bodies/rotation.hpp"

#include <cmath>

namespace espalier::dynamics {

Quat multiply(const Quat& a, const Quat& b) {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3], a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1], a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}

Quat quaternion_exp(const Vec3& x) {
  const double square = x.squaredNorm();
  double w = 0, factor = 0;
  if (square < 1e-4) {  // sin(a/2)/a and cos(a/2) to the last digit
    factor = 0.5 - square / 48 + square * square / 3840 - square * square * square / 645120;
    w = 1 - square / 8 + square * square / 384 - square * square * square / 46080;
  } else {
    const double angle = std::sqrt(square);
    factor = std::sin(angle / 2) / angle;
    w = std::cos(angle / 2);
  }
  return {w, factor * x[0], factor * x[1], factor * x[2]};
}

Vec3 quaternion_log(const Quat& q) {
  const Vec3 v = q[0] < 0 ? Vec3(-q.tail<3>()) : Vec3(q.tail<3>());
  const double w = std::abs(q[0]), s = v.norm();
  if (s < 1e-3) {  // angle = 2 asin(s): 2 (1 + s^2/6 + 3 s^4/40)
    const double square = s * s;
    return (2 + square / 3 + 0.15 * square * square) * v;
  }
  return (2 * std::atan2(s, w) / s) * v;
}

Quat quaternion_of(const Mat3& r) {
  const double trace = r.trace();
  Quat q;
  if (trace > 0) {
    q << 1 + trace, r(2, 1) - r(1, 2), r(0, 2) - r(2, 0), r(1, 0) - r(0, 1);
  } else {
    int i = 0;
    if (r(1, 1) > r(0, 0)) i = 1;
    if (r(2, 2) > r(i, i)) i = 2;
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    q[0] = r(k, j) - r(j, k);
    q[1 + i] = 1 + r(i, i) - r(j, j) - r(k, k);
    q[1 + j] = r(j, i) + r(i, j);
    q[1 + k] = r(k, i) + r(i, k);
  }
  return q.normalized();
}

Mat3 rotation_exp(const Vec3& x) { return rotation_matrix(quaternion_exp(x)); }
Vec3 rotation_log(const Mat3& r) { return quaternion_log(quaternion_of(r)); }

Vec3 tangent_times(const Vec3& x, const Vec3& x_dot) {
  const double square = x.squaredNorm();
  double a = 0, b = 0;
  if (square < 1e-4) {
    a = 0.5 - square / 24 + square * square / 720;
    b = 1.0 / 6 - square / 120 + square * square / 5040;
  } else {
    const double angle = std::sqrt(square);
    a = (1 - std::cos(angle)) / square;
    b = (angle - std::sin(angle)) / (square * angle);
  }
  const Vec3 once = x.cross(x_dot);
  return x_dot - a * once + b * x.cross(once);
}

namespace {

// g(x) = 1/x^2 - cot(x/2)/(2x) and g'(x)/x
struct Curvature {
  double g, slope;
};

Curvature curvature(double square) {
  if (square < 1e-2) {
    return {1.0 / 12 + square / 720 + square * square / 30240 + square * square * square / 1209600,
            1.0 / 360 + square / 7560 + square * square / 201600};
  }
  const double angle = std::sqrt(square), sine = std::sin(angle / 2), cotangent = std::cos(angle / 2) / sine;
  return {1 / square - cotangent / (2 * angle),
          -2 / (square * square) + cotangent / (2 * square * angle) + 1 / (4 * square * sine * sine)};
}

}  // namespace

Vec3 inverse_tangent_transposed_times(const Vec3& x, const Vec3& u) {
  return u + 0.5 * x.cross(u) + curvature(x.squaredNorm()).g * x.cross(x.cross(u));
}

Mat3 inverse_left_tangent(const Vec3& x) {
  const Mat3 s = skew(x);
  return Mat3::Identity() - 0.5 * s + curvature(x.squaredNorm()).g * s * s;
}

Mat3 inverse_tangent_transposed_derivative(const Vec3& x, const Vec3& u) {
  const Curvature c = curvature(x.squaredNorm());
  return -0.5 * skew(u) + c.slope * x.cross(x.cross(u)) * x.transpose() +
         c.g * (x.dot(u) * Mat3::Identity() + x * u.transpose() - 2 * u * x.transpose());
}

}  // namespace espalier::dynamics

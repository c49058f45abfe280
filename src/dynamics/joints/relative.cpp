#include "dynamics/joints/relative.hpp"

#include <cmath>

#include "base/at.hpp"
#include "dynamics/bodies/rotation.hpp"

namespace espalier::dynamics {

namespace {

void set(Row12& c, int block, const Vec3& value) {
  for (int k = 0; k < 3; ++k) c[at(3 * block + k)] = value[k];
}

enum Block { kRa, kPhiA, kRb, kPhiB };

// Gradient of the angle: n . (dphi_A - dphi_B) with n = p x x_B / D, p = c y_A - s x_A, c = x_B . x_A, s = x_B . y_A,
// D = c^2 + s^2 (derivative of atan2(s, c)). x_B stands for the axis j of frame B.
struct Angle {
  Vec3 xa, ya, xb, p, numerator, n;
  double c, s, square;
  Angle(const FrameMotion& a, const FrameMotion& b, int j) : xa(a.rot.col(0)), ya(a.rot.col(1)), xb(b.rot.col(j)) {
    c = xb.dot(xa);
    s = xb.dot(ya);
    square = c * c + s * s;
    if (!(square > 1e-12)) {
      throw Error(StatusCode::singular,
                  j == 0 ? "a joint angle is undefined: the x axis of frame B is parallel to the joint axis"
                         : "the axes of a worm or rack and of its wheel are parallel; they have to cross");
    }
    p = c * ya - s * xa;
    numerator = p.cross(xb);
    n = numerator / square;
  }
  // Change of n when the frames turn by the rates wa and wb.
  [[nodiscard]] Vec3 n_rate(const Vec3& wa, const Vec3& wb) const {
    const Vec3 xa_dot = wa.cross(xa), ya_dot = wa.cross(ya), xb_dot = wb.cross(xb);
    const double c_dot = xb_dot.dot(xa) + xb.dot(xa_dot), s_dot = xb_dot.dot(ya) + xb.dot(ya_dot);
    const Vec3 p_dot = c_dot * ya + c * ya_dot - s_dot * xa - s * xa_dot;
    return (p_dot.cross(xb) + p.cross(xb_dot)) / square - n * (2 * (c * c_dot + s * s_dot) / square);
  }
};

// Gradient of the polar angle, in global axes: f = (n x d) / rho^2, n = z_A and rho = |n x d|, the distance from the
// axis.
struct Polar {
  Vec3 n, d, turn, f;
  double square;
  Polar(const FrameMotion& a, const FrameMotion& b) : n(a.rot.col(2)), d(b.r - a.r), turn(n.cross(d)) {
    square = turn.squaredNorm();
    if (!(square > 1e-24 * d.squaredNorm())) {
      throw Error(StatusCode::singular,
                  "the centre of a wheel stands on the axis of the other one and has no direction from there; the "
                  "frames of two wheels, or of worm and wheel, are at their centres, apart from each other");
    }
    f = turn / square;
  }
  // Change of f when A turns at wa and d changes at d_dot.
  [[nodiscard]] Vec3 f_rate(const Vec3& wa, const Vec3& d_dot) const {
    const Vec3 turn_dot = wa.cross(n).cross(d) + n.cross(d_dot);
    return (turn_dot - 2 * turn.dot(turn_dot) / square * turn) / square;
  }
};

// Gradient of the angle between z_A and z_B: u . (dphi_B - dphi_A), u = z_A x z_B / sin.
struct Bend {
  Vec3 za, zb, cross, u = Vec3::Zero();
  double sine;
  Bend(const FrameMotion& a, const FrameMotion& b) : za(a.rot.col(2)), zb(b.rot.col(2)), cross(za.cross(zb)) {
    sine = cross.norm();
    if (has_direction()) u = cross / sine;
  }
  [[nodiscard]] bool has_direction() const { return sine > 1e-12; }
  [[nodiscard]] Vec3 u_rate(const Vec3& wa, const Vec3& wb) const {
    if (!has_direction()) return Vec3::Zero();
    const Vec3 rate = wa.cross(za).cross(zb) + za.cross(wb.cross(zb));
    return (rate - u.dot(rate) * u) / sine;
  }
};

struct Distance {
  Vec3 u;
  double length;
  Distance(const FrameMotion& a, const FrameMotion& b) : u(b.r - a.r), length(u.norm()) {
    if (!(length > 0)) {
      throw Error(StatusCode::singular,
                  "the distance of two points has become zero and has no direction; hold points that coincide by a "
                  "spherical joint, begin a spring with its ends apart");
    }
    u /= length;
  }
};

}  // namespace

void evaluate(Relative kind, int i, int j, const FrameMotion& a, const FrameMotion& b, bool rates, RelativeValue& out) {
  out.c.fill(0);
  out.curvature = 0;
  switch (kind) {
    case Relative::global: {
      out.value = b.r[i] - a.r[i];
      out.c[at(i)] = -1;
      out.c[at(6 + i)] = 1;
      return;
    }
    case Relative::along: {
      const Vec3 axis = a.rot.col(i), d = b.r - a.r, turn = axis.cross(d);
      out.value = axis.dot(d);
      set(out.c, kRa, -axis);
      set(out.c, kPhiA, turn);
      set(out.c, kRb, axis);
      if (!rates) return;
      const Vec3 axis_dot = a.omega.cross(axis), d_dot = b.vel - a.vel;
      out.curvature = axis_dot.dot(d_dot) + (axis_dot.cross(d) + axis.cross(d_dot)).dot(a.omega);
      return;
    }
    case Relative::dot: {
      const Vec3 x = a.rot.col(i), y = b.rot.col(j), n = x.cross(y);
      out.value = x.dot(y);
      set(out.c, kPhiA, n);
      set(out.c, kPhiB, -n);
      if (!rates) return;
      const Vec3 n_dot = a.omega.cross(x).cross(y) + x.cross(b.omega.cross(y));
      out.curvature = n_dot.dot(a.omega - b.omega);
      return;
    }
    case Relative::distance: {
      const Distance d(a, b);
      out.value = d.length;
      set(out.c, kRa, -d.u);
      set(out.c, kRb, d.u);
      if (!rates) return;
      const Vec3 d_dot = b.vel - a.vel;
      const double along = d.u.dot(d_dot);
      out.curvature = (d_dot.squaredNorm() - along * along) / d.length;
      return;
    }
    case Relative::angle: {
      const Angle angle(a, b, j);
      out.value = std::atan2(angle.s, angle.c);
      set(out.c, kPhiA, angle.n);
      set(out.c, kPhiB, -angle.n);
      if (rates) out.curvature = angle.n_rate(a.omega, b.omega).dot(a.omega - b.omega);
      return;
    }
    case Relative::polar: {
      const Polar polar(a, b);
      const Vec3 d_dot = b.vel - a.vel;
      out.value = std::atan2(polar.d.dot(a.rot.col(1)), polar.d.dot(a.rot.col(0)));
      set(out.c, kRa, -polar.f);
      set(out.c, kPhiA, polar.f.cross(polar.d));
      set(out.c, kRb, polar.f);
      if (!rates) return;
      const Vec3 f_dot = polar.f_rate(a.omega, d_dot);
      out.curvature = f_dot.dot(d_dot) + (f_dot.cross(polar.d) + polar.f.cross(d_dot)).dot(a.omega);
      return;
    }
    case Relative::bend: {
      const Bend bend(a, b);
      out.value = std::atan2(bend.sine, bend.za.dot(bend.zb));
      set(out.c, kPhiA, -bend.u);
      set(out.c, kPhiB, bend.u);
      if (rates) out.curvature = bend.u_rate(a.omega, b.omega).dot(b.omega - a.omega);
      return;
    }
  }
}

void add_curvature(Relative kind, int i, int j, const FrameMotion& a, const FrameMotion& b, double factor, Mat12& k) {
  switch (kind) {
    case Relative::global:
      return;
    case Relative::along: {
      const Vec3 axis = a.rot.col(i), d = b.r - a.r;
      const Mat3 s = factor * skew(axis), t = factor * skew(d) * skew(axis);
      k.block<3, 3>(0, 3) += s;  // d(-axis) = axis~ dphi_A
      k.block<3, 3>(6, 3) -= s;
      k.block<3, 3>(3, 3) += t;  // d(axis x d) = d~ axis~ dphi_A + axis~ (dr_B - dr_A)
      k.block<3, 3>(3, 6) += s;
      k.block<3, 3>(3, 0) -= s;
      return;
    }
    case Relative::dot: {
      const Mat3 x = skew(a.rot.col(i)), y = skew(b.rot.col(j));
      const Mat3 yx = factor * y * x, xy = factor * x * y;  // dn = y~ x~ dphi_A - x~ y~ dphi_B
      k.block<3, 3>(3, 3) += yx;
      k.block<3, 3>(3, 9) -= xy;
      k.block<3, 3>(9, 3) -= yx;
      k.block<3, 3>(9, 9) += xy;
      return;
    }
    case Relative::distance: {
      const Distance d(a, b);
      const Mat3 p = factor / d.length * (Mat3::Identity() - d.u * d.u.transpose());
      k.block<3, 3>(0, 0) += p;
      k.block<3, 3>(0, 6) -= p;
      k.block<3, 3>(6, 0) -= p;
      k.block<3, 3>(6, 6) += p;
      return;
    }
    case Relative::angle: {
      const Angle angle(a, b, j);
      for (int e = 0; e < 3; ++e) {
        const Vec3 by_a = factor * angle.n_rate(Vec3::Unit(e), Vec3::Zero());
        const Vec3 by_b = factor * angle.n_rate(Vec3::Zero(), Vec3::Unit(e));
        k.block<3, 1>(3, 3 + e) += by_a;
        k.block<3, 1>(3, 9 + e) += by_b;
        k.block<3, 1>(9, 3 + e) -= by_a;
        k.block<3, 1>(9, 9 + e) -= by_b;
      }
      return;
    }
    case Relative::polar: {
      const Polar polar(a, b);
      const auto add = [&](int column, const Vec3& f_dot, const Vec3& d_dot) {
        const Vec3 moment = f_dot.cross(polar.d) + polar.f.cross(d_dot);
        k.block<3, 1>(0, column) -= factor * f_dot;
        k.block<3, 1>(3, column) += factor * moment;
        k.block<3, 1>(6, column) += factor * f_dot;
      };
      for (int e = 0; e < 3; ++e) {
        const Vec3 unit = Vec3::Unit(e);
        add(e, polar.f_rate(Vec3::Zero(), -unit), -unit);
        add(3 + e, polar.f_rate(unit, Vec3::Zero()), Vec3::Zero());
        add(6 + e, polar.f_rate(Vec3::Zero(), unit), unit);
      }
      return;
    }
    case Relative::bend: {
      const Bend bend(a, b);
      for (int e = 0; e < 3; ++e) {
        const Vec3 by_a = factor * bend.u_rate(Vec3::Unit(e), Vec3::Zero());
        const Vec3 by_b = factor * bend.u_rate(Vec3::Zero(), Vec3::Unit(e));
        k.block<3, 1>(3, 3 + e) -= by_a;
        k.block<3, 1>(3, 9 + e) -= by_b;
        k.block<3, 1>(9, 3 + e) += by_a;
        k.block<3, 1>(9, 9 + e) += by_b;
      }
      return;
    }
  }
}

bool curves_in_translation(Relative kind) {
  return kind == Relative::along || kind == Relative::distance || kind == Relative::polar;
}

}  // namespace espalier::dynamics

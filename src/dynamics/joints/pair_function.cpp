#include "dynamics/joints/pair_function.hpp"

#include "dynamics/bodies/rotation.hpp"

namespace espalier::dynamics {
namespace {

void set_block(Row12& c, std::size_t first, const Vec3& value) {
  for (std::size_t k = 0; k < 3; ++k) c[first + k] = value[static_cast<Eigen::Index>(k)];
}

}  // namespace

// With f = A grad, d = r_B - r_A:  d value = f . (dr_B - dr_A) + (f x d) . dphi_A
void PointFunction::evaluate(const FrameMotion& a, const FrameMotion& b, bool rates, RelativeValue& out) const {
  const Vec3 d = b.r - a.r;
  const At point = at(a.rot.transpose() * d);
  const Vec3 f = a.rot * point.gradient;
  out.value = point.value;
  out.c.fill(0);
  out.curvature = 0;
  set_block(out.c, 0, -f);
  set_block(out.c, 3, f.cross(d));
  set_block(out.c, 6, f);
  if (!rates) return;
  const Vec3 d_dot = b.vel - a.vel;
  const Vec3 seen = a.rot.transpose() * Vec3(d_dot - a.omega.cross(d));  // the velocity in the axes of A
  const Vec3 f_dot = a.rot * Vec3(point.hessian * seen) + a.omega.cross(f);
  out.curvature = f_dot.dot(d_dot) + (f_dot.cross(d) + f.cross(d_dot)).dot(a.omega);
}

// df = A H A^T (dd - dphi_A x d) + dphi_A x f
void PointFunction::add_curvature(const FrameMotion& a, const FrameMotion& b, double factor, Mat12& k) const {
  const Vec3 d = b.r - a.r;
  const At point = at(a.rot.transpose() * d);
  const Vec3 f = factor * (a.rot * point.gradient);
  const Mat3 h = factor * (a.rot * point.hessian * a.rot.transpose());
  const Mat3 arm = skew(d), by_turn = h * arm - skew(f);
  k.block<3, 3>(0, 0) += h;
  k.block<3, 3>(0, 3) -= by_turn;
  k.block<3, 3>(0, 6) -= h;
  k.block<3, 3>(6, 0) -= h;
  k.block<3, 3>(6, 3) += by_turn;
  k.block<3, 3>(6, 6) += h;
  const Mat3 by_place = skew(f) - arm * h;  // d(f x d) = f~ dd - d~ df
  k.block<3, 3>(3, 0) -= by_place;
  k.block<3, 3>(3, 3) -= arm * by_turn;
  k.block<3, 3>(3, 6) += by_place;
}

void PairSum::evaluate(const FrameMotion& a, const FrameMotion& b, bool rates, RelativeValue& out) const {
  out = {};
  RelativeValue value;
  for (const Term& part : parts_) {
    dynamics::evaluate(part.coordinate, part.swapped ? b : a, part.swapped ? a : b, rates, value);
    out.value += part.factor * value.value;
    out.curvature += part.factor * value.curvature;
    for (std::size_t i = 0; i < 12; ++i) out.c[i] += part.factor * value.c[part.swapped ? (i + 6) % 12 : i];
  }
}

void PairSum::add_curvature(const FrameMotion& a, const FrameMotion& b, double factor, Mat12& k) const {
  for (const Term& part : parts_) {
    if (!part.swapped) {
      dynamics::add_curvature(part.coordinate, a, b, factor * part.factor, k);
      continue;
    }
    Mat12 own = Mat12::Zero();
    dynamics::add_curvature(part.coordinate, b, a, factor * part.factor, own);
    for (const Eigen::Index i : {0, 6})
      for (const Eigen::Index j : {0, 6}) k.block<6, 6>(i, j) += own.block<6, 6>(6 - i, 6 - j);
  }
}

void evaluate(const PairCoordinate& g, const FrameMotion& a, const FrameMotion& b, bool rates, RelativeValue& out) {
  if (g.function) return g.function->evaluate(a, b, rates, out);
  evaluate(g.kind, g.axis, g.other, a, b, rates, out);
}

void add_curvature(const PairCoordinate& g, const FrameMotion& a, const FrameMotion& b, double factor, Mat12& k) {
  if (g.function) return g.function->add_curvature(a, b, factor, k);
  add_curvature(g.kind, g.axis, g.other, a, b, factor, k);
}

}  // namespace espalier::dynamics

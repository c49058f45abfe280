#include "dynamics/bodies/reduced_frame.hpp"

#include "dense/dense.hpp"
#include "dynamics/bodies/axial.hpp"

namespace espalier::dynamics {
namespace {

Mat3 spread_of(const Mat3& s) { return s.trace() * Mat3::Identity() - s; }

using Jacobian = Eigen::Map<Eigen::Matrix<double, 6, Eigen::Dynamic>>;

}  // namespace

ReducedFrame::ReducedFrame(const ReducedBody& body, const FlexibleFrame& nodal)
    : body_(body), axes_(nodal.axes()), has_rotation_(nodal.has_rotation()) {
  const FlexibleBody& mesh = body.nodal();
  const Eigen::Index n = body.modes();
  place_by_.setZero(3, n);
  fit_by_.setZero(9, n);
  for (const FrameVertex& vertex : nodal.vertices()) {
    Vec3 x = Eigen::Map<const Vec3>(mesh.reference().data() + 3 * vertex.vertex);
    if (vertex.vertex % mesh.vertices_per_node() == 0) x -= body.shapes().centre;
    const auto shape = body.shapes().shapes.middleRows(3 * vertex.vertex, 3);
    place_ += vertex.weight * x;
    place_by_ += vertex.weight * shape;
    fit_ += x * vertex.arm.transpose();
    for (int j = 0; j < 3; ++j) fit_by_.middleRows(3 * j, 3) += vertex.arm[j] * shape;
  }
}

ReducedFrame::Fit ReducedFrame::fit(ConstSpan q) const {
  const auto eta = body_.amplitudes(q);
  Fit result;
  result.place = place_ + place_by_ * eta;
  if (!has_rotation_) return result;
  const Eigen::Matrix<double, 9, 1> by_shapes = fit_by_ * eta;
  const Mat3 a = fit_ + Eigen::Map<const Mat3>(by_shapes.data());
  result.turn = dense::nearest_rotation(a).rotation;
  result.stretch = result.turn.transpose() * a;
  result.inverse_g = spread_of(result.stretch).inverse();
  return result;
}

Mat3 ReducedFrame::turned(const Fit& f, Eigen::Index k) const {
  return f.turn.transpose() * Eigen::Map<const Mat3>(fit_by_.col(k).data());
}

Eigen::Matrix3Xd ReducedFrame::turns_of_shapes(const Fit& f) const {
  Eigen::Matrix3Xd result(3, fit_by_.cols());
  for (Eigen::Index k = 0; k < result.cols(); ++k) result.col(k) = f.inverse_g * axial(turned(f, k));
  return result;
}

void ReducedFrame::motion(ConstSpan q, ConstSpan v, FrameMotion& out) const {
  out = FrameMotion{};
  const Fit f = fit(q);
  const Mat3 r = rotation_matrix(body_.quaternion(q));
  out.r = body_.position(q) + r * f.place;
  out.rot = r * f.turn * axes_;
  if (v.empty()) return;
  const Vec3 omega = body_.angular(v), speed = place_by_ * body_.rates(v);
  out.vel = body_.velocity(v) + r * (omega.cross(f.place) + speed);
  out.bias_acc = r * omega.cross(omega.cross(f.place) + 2 * speed);
  if (!has_rotation_) return;
  const Eigen::Matrix<double, 9, 1> fit_rate = fit_by_ * body_.rates(v);
  const Mat3 rate = f.turn.transpose() * Eigen::Map<const Mat3>(fit_rate.data());
  const Vec3 own = f.inverse_g * axial(rate);  // of Q against the body, in the axes of Q
  out.omega = r * (omega + f.turn * own);
  // G own' = d/dt axial(Q^T A') - G' own at constant rates; Q^T A' turns by -own, S' = Q^T A' - own~ S.
  const Vec3 own_rate = f.inverse_g * (-spread_of(rate - skew(own) * f.stretch) * own - spread_of(rate) * own);
  out.bias_alpha = r * (omega.cross(f.turn * own) + f.turn * own_rate);
}

void ReducedFrame::jacobian(ConstSpan q, double* j) const {
  const Fit f = fit(q);
  const Mat3 r = rotation_matrix(body_.quaternion(q));
  const Eigen::Index n = body_.modes();
  Jacobian result(j, 6, 6 + n);
  result.setZero();
  result.topLeftCorner<3, 3>().setIdentity();
  result.block<3, 3>(0, 3) = -r * skew(f.place);
  result.topRightCorner(3, n) = r * place_by_;
  if (!has_rotation_) return;
  result.block<3, 3>(3, 3) = r;
  result.bottomRightCorner(3, n) = r * f.turn * turns_of_shapes(f);
}

void ReducedFrame::rate_jacobian(ConstSpan q, ConstSpan v, double* jv) const {
  const Fit f = fit(q);
  const Mat3 r = rotation_matrix(body_.quaternion(q));
  const Eigen::Index n = body_.modes();
  const Vec3 omega = body_.angular(v), speed = place_by_ * body_.rates(v);
  Jacobian result(jv, 6, 6 + n);
  result.setZero();
  result.block<3, 3>(0, 3) = -r * skew(omega.cross(f.place) + speed);
  result.topRightCorner(3, n) = r * skew(omega) * place_by_;
  if (!has_rotation_) return;
  const Eigen::Matrix<double, 9, 1> fit_rate = fit_by_ * body_.rates(v);
  const Mat3 rate = f.turn.transpose() * Eigen::Map<const Mat3>(fit_rate.data());
  const Vec3 own = f.inverse_g * axial(rate);
  result.block<3, 3>(3, 3) = -r * skew(omega + f.turn * own);
  const Eigen::Matrix3Xd turns = turns_of_shapes(f);
  for (Eigen::Index k = 0; k < n; ++k) {
    const Vec3 phi = turns.col(k);
    const Mat3 d_stretch = turned(f, k) - skew(phi) * f.stretch;
    const Vec3 d_own = f.inverse_g * (-spread_of(rate) * phi - spread_of(d_stretch) * own);
    result.block<3, 1>(3, 6 + k) = r * f.turn * (phi.cross(own) + d_own);
  }
}

/// With f and m in the axes of the body, J^T [f; m] has the rows f (global), p x f + m and p_k . f + c . axial(Q^T
/// A_k), G c = Q^T m.
void ReducedFrame::wrench_stiffness(ConstSpan q, const Vec6& wrench, double scale, double* k) const {
  const Fit f = fit(q);
  const Mat3 r = rotation_matrix(body_.quaternion(q));
  const Eigen::Index n = body_.modes();
  Eigen::Map<Eigen::MatrixXd> block(k, 6 + n, 6 + n);
  const Vec3 force = r.transpose() * wrench.head<3>(), moment = r.transpose() * wrench.tail<3>();
  block.block<3, 3>(3, 3) += scale * skew(f.place) * skew(force);
  block.block(3, 6, 3, n) -= scale * skew(force) * place_by_;
  block.block(6, 3, n, 3) += scale * place_by_.transpose() * skew(force);
  if (!has_rotation_) return;
  const Eigen::Matrix3Xd turns = turns_of_shapes(f);
  block.block<3, 3>(3, 3) += scale * skew(moment);
  block.block(6, 3, n, 3) += scale * turns.transpose() * f.turn.transpose() * skew(moment);
  const Vec3 own = f.turn.transpose() * moment, c = f.inverse_g * own;
  Eigen::Matrix3Xd axials(3, n);
  for (Eigen::Index i = 0; i < n; ++i) axials.col(i) = axial(turned(f, i));
  for (Eigen::Index l = 0; l < n; ++l) {
    const Vec3 phi = turns.col(l);
    const Vec3 dc = f.inverse_g * (-phi.cross(own) - spread_of(turned(f, l) - skew(phi) * f.stretch) * c);
    // c . axial(-phi~ T) is the sum of T and X, entry by entry
    Mat3 x = -(skew(phi).transpose() * skew(c));
    const Mat3 back = f.turn * x;
    block.col(6 + l).tail(n) +=
        scale *
        (axials.transpose() * dc + fit_by_.transpose() * Eigen::Map<const Eigen::Matrix<double, 9, 1>>(back.data()));
  }
}

}  // namespace espalier::dynamics

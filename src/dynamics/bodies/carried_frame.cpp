#include "dynamics/bodies/carried_frame.hpp"

#include <stdexcept>
#include <vector>

#include "dynamics/bodies/rotation.hpp"

namespace espalier::dynamics {
namespace {

using Columns = Eigen::Matrix<double, 6, Eigen::Dynamic>;

Columns jacobian_of(const Frame& frame, ConstSpan q) {
  Columns j(6, static_cast<Eigen::Index>(frame.coordinates().size()));
  frame.jacobian(q, j.data());
  return j;
}

}  // namespace

CarriedFrame::CarriedFrame(std::unique_ptr<Frame> base, const Vec3& offset, const Mat3& turn)
    : base_(std::move(base)), offset_(offset), turn_(turn) {
  if (!base_ || !base_->has_rotation())
    throw std::invalid_argument("a frame without rotation can carry no other frame");
}

void CarriedFrame::motion(ConstSpan q, ConstSpan v, FrameMotion& out) const {
  base_->motion(q, v, out);
  const Vec3 arm = out.rot * offset_;
  out.r += arm;
  out.rot *= turn_;
  out.vel += out.omega.cross(arm);
  out.bias_acc += out.bias_alpha.cross(arm) + out.omega.cross(out.omega.cross(arm));
}

/// delta r = delta r_base + delta phi x arm
void CarriedFrame::jacobian(ConstSpan q, double* j) const {
  FrameMotion m;
  base_->motion(q, {}, m);
  base_->jacobian(q, j);
  Eigen::Map<Columns> columns(j, 6, static_cast<Eigen::Index>(coordinates().size()));
  columns.topRows<3>() -= skew(m.rot * offset_) * columns.bottomRows<3>();
}

/// J^T [f; m] = J_base^T [f; m + arm x f]
void CarriedFrame::project(ConstSpan q, const FrameMotion& /*motion*/, const double* c, int count, double* out) const {
  FrameMotion m;
  base_->motion(q, {}, m);
  Columns at_base = Eigen::Map<const Columns>(c, 6, count);
  at_base.bottomRows<3>() += skew(m.rot * offset_) * at_base.topRows<3>();
  base_->project(q, m, at_base.data(), count, out);
}

/// delta(vel_base + omega x arm) = delta vel_base + delta omega x arm + omega x (delta phi x arm)
void CarriedFrame::rate_jacobian(ConstSpan q, ConstSpan v, double* jv) const {
  FrameMotion m;
  base_->motion(q, v, m);
  base_->rate_jacobian(q, v, jv);
  const Mat3 arm = skew(m.rot * offset_);
  Eigen::Map<Columns> columns(jv, 6, static_cast<Eigen::Index>(coordinates().size()));
  columns.topRows<3>() -= arm * columns.bottomRows<3>();
  columns.topRows<3>() -= skew(m.omega) * arm * jacobian_of(*base_, q).bottomRows<3>();
}

/// J^T [f; m] = J_base^T [f; m + arm x f], and delta(arm x f) = (delta phi x arm) x f = f~ arm~ delta phi.
void CarriedFrame::wrench_stiffness(ConstSpan q, const Vec6& wrench, double scale, double* k) const {
  FrameMotion m;
  base_->motion(q, {}, m);
  const Vec3 arm = m.rot * offset_, force = wrench.head<3>();
  Vec6 at_base = wrench;
  at_base.tail<3>() += arm.cross(force);
  base_->wrench_stiffness(q, at_base, scale, k);
  const auto n = static_cast<Eigen::Index>(coordinates().size());
  const Eigen::Matrix<double, 3, Eigen::Dynamic> turns = jacobian_of(*base_, q).bottomRows<3>();
  Eigen::Map<Eigen::MatrixXd>(k, n, n) += scale * turns.transpose() * (skew(force) * skew(arm) * turns);
}

/// As above: J^T [f; m] is that of the base with the moment m + arm x f, and f~ arm~ delta phi is one more moment.
void CarriedFrame::tangent_columns(ConstSpan q, const TangentColumns& columns, double* out) const {
  FrameMotion m;
  base_->motion(q, {}, m);
  const Mat3 arm = skew(m.rot * offset_);
  const auto count = static_cast<Eigen::Index>(columns.count);
  Columns c = Eigen::Map<const Columns>(columns.c, 6, count);
  c.bottomRows<3>() += arm * c.topRows<3>();
  Vec6 wrench = columns.wrench;
  const Vec3 force = wrench.head<3>();
  if (!force.isZero(0))
    c.bottomRows<3>() += skew(force) * arm * Eigen::Map<const Columns>(columns.twists, 6, count).bottomRows<3>();
  wrench.tail<3>() += arm * force;
  base_->tangent_columns(q, {columns.first, columns.count, c.data(), columns.twists, wrench}, out);
}

}  // namespace espalier::dynamics

#include "dynamics/dae/frame.hpp"

#include <algorithm>
#include <vector>

#include "base/at.hpp"

namespace espalier::dynamics {

void Frame::wrench_stiffness(ConstSpan /*q*/, const Vec6& /*wrench*/, double /*scale*/, double* /*k*/) const {}

void Frame::tangent_columns(ConstSpan q, const TangentColumns& columns, double* out) const {
  const auto nd = static_cast<Eigen::Index>(coordinates().size()), count = static_cast<Eigen::Index>(columns.count);
  using SixRows = Eigen::Matrix<double, 6, Eigen::Dynamic>;
  SixRows j(6, nd);
  jacobian(q, j.data());
  Eigen::Map<Eigen::MatrixXd> result(out, nd, count);
  result.noalias() = j.transpose() * Eigen::Map<const SixRows>(columns.c, 6, count);
  if (!has_wrench_stiffness() || columns.wrench.isZero(0)) return;
  Eigen::MatrixXd stiffness = Eigen::MatrixXd::Zero(nd, nd);
  wrench_stiffness(q, columns.wrench, 1, stiffness.data());
  result += stiffness.middleCols(static_cast<Eigen::Index>(columns.first), count);
}

void Frame::project(ConstSpan q, const FrameMotion& /*motion*/, const double* c, int count, double* out) const {
  const std::size_t nd = coordinates().size();
  std::vector<double> j(6 * nd);
  jacobian(q, j.data());
  for (std::size_t r = 0; r < at(count); ++r) {
    for (std::size_t k = 0; k < nd; ++k) {
      double sum = 0;
      for (std::size_t i = 0; i < 6; ++i) sum += c[6 * r + i] * j[6 * k + i];
      out[r * nd + k] = sum;
    }
  }
}

void Frame::rate_jacobian(ConstSpan /*q*/, ConstSpan /*v*/, double* jv) const {
  std::fill_n(jv, 6 * coordinates().size(), 0.0);
}

void GroundFrame::motion(ConstSpan /*q*/, ConstSpan /*v*/, FrameMotion& out) const {
  out = FrameMotion{};
  out.r = r_;
  out.rot = rot_;
}

void GroundFrame::jacobian(ConstSpan /*q*/, double* /*j*/) const {}

}  // namespace espalier::dynamics

/// \file
/// Frames on reduced bodies: what a frame on the nodes is when they follow rigid motion and shapes.
#pragma once

#include <memory>
#include <vector>

#include "dynamics/bodies/flexible_frame.hpp"
#include "dynamics/bodies/reduced_body.hpp"

namespace espalier::dynamics {

/// The frame of FlexibleFrame with x_a = r + R u_a(eta): its origin is r + R p, p = sum w_a u_a, and its rotation R Q,
/// Q from the polar decomposition Q S of A = sum u_a B_a^T. Both p and A are linear in eta, so a frame costs 12 numbers
/// for each shape, whatever the number of its nodes. With G = tr(S) I - S the shape k turns Q by G^-1 axial(Q^T A_k),
/// in the axes of Q. The body must outlive the frame.
class ReducedFrame final : public Frame {
 public:
  /// @param nodal a frame on body.nodal()
  ReducedFrame(const ReducedBody& body, const FlexibleFrame& nodal);

  [[nodiscard]] std::span<const Index> coordinates() const override { return body_.coordinates(); }
  [[nodiscard]] bool has_rotation() const override { return has_rotation_; }
  void motion(ConstSpan q, ConstSpan v, FrameMotion& out) const override;
  void jacobian(ConstSpan q, double* j) const override;
  void rate_jacobian(ConstSpan q, ConstSpan v, double* jv) const override;
  [[nodiscard]] bool turns(std::size_t k) const override { return has_rotation_ && k >= 3; }
  [[nodiscard]] bool has_wrench_stiffness() const override { return true; }
  void wrench_stiffness(ConstSpan q, const Vec6& wrench, double scale, double* k) const override;

 private:
  /// Place and turn in the axes of the body.
  struct Fit {
    Vec3 place;
    Mat3 turn = Mat3::Identity(), stretch = Mat3::Identity(), inverse_g = Mat3::Zero();
  };
  [[nodiscard]] Fit fit(ConstSpan q) const;
  /// Q^T A_k.
  [[nodiscard]] Mat3 turned(const Fit& f, Eigen::Index k) const;
  /// The turns by each shape, in the axes of Q.
  [[nodiscard]] Eigen::Matrix3Xd turns_of_shapes(const Fit& f) const;

  const ReducedBody& body_;
  Mat3 axes_;
  bool has_rotation_;
  Vec3 place_ = Vec3::Zero();  // p and A at rest, and what each shape adds
  Mat3 fit_ = Mat3::Zero();
  Eigen::Matrix3Xd place_by_;
  Eigen::Matrix<double, 9, Eigen::Dynamic> fit_by_;
};

}  // namespace espalier::dynamics

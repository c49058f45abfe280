/// \file
/// A frame that another frame carries like a rigid arm.
#pragma once

#include <memory>

#include "dynamics/dae/frame.hpp"

namespace espalier::dynamics {

/// r = r_base + R_base offset, R = R_base turn: how a joint holds a face where it is, although its own origin and axes
/// lie beside the face's mean.
class CarriedFrame final : public Frame {
 public:
  /// @param base must have a rotation
  /// @param offset in the axes of base @param turn columns: the axes, in those of base
  CarriedFrame(std::unique_ptr<Frame> base, const Vec3& offset, const Mat3& turn);

  [[nodiscard]] std::span<const Index> coordinates() const override { return base_->coordinates(); }
  void motion(ConstSpan q, ConstSpan v, FrameMotion& out) const override;
  void jacobian(ConstSpan q, double* j) const override;
  void project(ConstSpan q, const FrameMotion& motion, const double* c, int count, double* out) const override;
  void rate_jacobian(ConstSpan q, ConstSpan v, double* jv) const override;
  [[nodiscard]] bool turns(std::size_t k) const override { return base_->turns(k); }
  [[nodiscard]] bool has_wrench_stiffness() const override { return true; }
  void wrench_stiffness(ConstSpan q, const Vec6& wrench, double scale, double* k) const override;
  void tangent_columns(ConstSpan q, const TangentColumns& columns, double* out) const override;

 private:
  std::unique_ptr<Frame> base_;
  Vec3 offset_;
  Mat3 turn_;
};

}  // namespace espalier::dynamics

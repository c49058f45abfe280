/// \file
/// Rigid bodies in three dimensions.
#pragma once

#include <array>

#include "dynamics/bodies/rotation.hpp"
#include "dynamics/dae/capabilities.hpp"

namespace espalier::dynamics {

struct RigidBodyData {
  double mass = 1;                       ///< kg
  Mat3 inertia = Mat3::Identity();       ///< about the centre of mass, in body axes, kg m^2; symmetric
  Vec3 position = Vec3::Zero();          ///< of the centre of mass
  Quat rotation = Quat(1, 0, 0, 0);      ///< body axes to global axes
  Vec3 velocity = Vec3::Zero();          ///< of the centre of mass
  Vec3 angular_velocity = Vec3::Zero();  ///< in global axes
  Vec3 gravity = Vec3::Zero();           ///< acceleration of gravity
};

/// A rigid body. Configuration: position of the centre of mass and a unit quaternion (7 numbers). Velocities: velocity
/// of the centre of mass in global axes and angular velocity in body axes (6). Increments of the rotation are body
/// rotation vectors, R (+) x = R exp(x~): a group update without singular angles.
/// Newton-Euler: m (a - g) = 0, J alpha + omega x J omega = 0.
class RigidBody final : public Component, public Curved {
 public:
  /// @throws std::invalid_argument if mass or inertia is not positive, or a number is not finite
  RigidBody(std::string name, const RigidBodyData& data);

  [[nodiscard]] const RigidBodyData& data() const { return data_; }
  [[nodiscard]] Vec3 position(ConstSpan q) const;
  [[nodiscard]] Quat quaternion(ConstSpan q) const;
  [[nodiscard]] Vec3 velocity(ConstSpan v) const;
  /// Angular velocity (or, given a, acceleration) in body axes.
  [[nodiscard]] Vec3 angular(ConstSpan v) const;

  [[nodiscard]] Sizes sizes() const override { return {7, 6, 0}; }
  void place(const Placement& at) override;
  [[nodiscard]] const std::array<Index, 6>& coordinates() const { return coordinates_; }
  [[nodiscard]] std::string coordinate_name(Index local_coordinate) const override;
  void initial(Span q, Span v) const override;
  void retract(ConstSpan q, ConstSpan dq, Span q_out) const override;
  void local(ConstSpan base, ConstSpan q, Span theta) const override;
  void velocity_of_rate(ConstSpan theta, ConstSpan theta_dot, Span v) const override;
  void rate_of_velocity(ConstSpan theta, ConstSpan v, Span theta_dot) const override;
  void carry(ConstSpan theta, std::span<const Span> vectors) const override;
  void magnitude(ConstSpan q, Span out) const override;
  void declare(PatternBuilder& w, PatternBuilder& phi_q) const override;
  void bind(const SparsePattern& w, const SparsePattern& phi_q) override;
  void residual(const StateView& s, Span f) override;
  void tangent(const StateView& s, const TangentWeights& weights, Span w_values) override;
  [[nodiscard]] Energy energy(const StateView& s) override;

 private:
  RigidBodyData data_;
  std::array<Index, 6> coordinates_{};
  std::array<Offset, 3> mass_position_{};
  std::array<Offset, 9> inertia_position_{};
};

/// A frame fixed to a rigid body at `point` (body axes, from the centre of mass) with axes `rotation` (to body axes).
class RigidFrame final : public Frame {
 public:
  explicit RigidFrame(const RigidBody& body, const Vec3& point = Vec3::Zero(), const Mat3& rotation = Mat3::Identity())
      : body_(&body), point_(point), rotation_(rotation) {}

  [[nodiscard]] const RigidBody& body() const { return *body_; }
  [[nodiscard]] const Vec3& point() const { return point_; }
  [[nodiscard]] const Mat3& rotation() const { return rotation_; }
  [[nodiscard]] std::span<const Index> coordinates() const override { return body_->coordinates(); }
  void motion(ConstSpan q, ConstSpan v, FrameMotion& out) const override;
  void jacobian(ConstSpan q, double* j) const override;
  void project(ConstSpan q, const FrameMotion& motion, const double* c, int count, double* out) const override;
  void rate_jacobian(ConstSpan q, ConstSpan v, double* jv) const override;
  [[nodiscard]] bool turns(std::size_t k) const override { return k >= 3; }
  [[nodiscard]] bool has_wrench_stiffness() const override { return true; }
  void wrench_stiffness(ConstSpan q, const Vec6& wrench, double scale, double* k) const override;

 private:
  const RigidBody* body_;
  Vec3 point_;
  Mat3 rotation_;
};

/// The frame on a body (in the given state of the model) that coincides with a place and axes given globally.
[[nodiscard]] std::unique_ptr<Frame> frame_at(const RigidBody& body, const Vec3& global_point,
                                              const Mat3& global_axes = Mat3::Identity());

}  // namespace espalier::dynamics

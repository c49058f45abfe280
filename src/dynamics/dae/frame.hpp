/// \file
/// A frame carried by a body: the only thing that joints and forces know of a body. Rigid bodies, ground, flexible
/// nodes and averaged faces implement it, so every joint and every force works between any of them.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <span>

#include "dynamics/dae/system.hpp"

namespace espalier::dynamics {

using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;
using Vec6 = Eigen::Matrix<double, 6, 1>;

/// Motion of a frame, all in global components. The twist is [dr/dt; omega] = J v; its derivative J a + bias.
struct FrameMotion {
  Vec3 r = Vec3::Zero();             ///< position of the origin
  Mat3 rot = Mat3::Identity();       ///< columns: axes of the frame
  Vec3 vel = Vec3::Zero();           ///< velocity of the origin
  Vec3 omega = Vec3::Zero();         ///< angular velocity
  Vec3 bias_acc = Vec3::Zero();      ///< part of the origin's acceleration that does not contain a
  Vec3 bias_alpha = Vec3::Zero();    ///< part of the angular acceleration that does not contain a
  Mat3 body_rot = Mat3::Identity();  ///< scratch of the frame's own: what project() may want to know again
  Vec3 arm = Vec3::Zero();           ///< scratch of the frame's own
};

/// A frame that depends on a fixed, ordered list of nd velocity coordinates.
class Frame {
 public:
  virtual ~Frame() = default;
  /// The global indices of the nd velocity coordinates. Valid after the body was placed; empty for the ground.
  [[nodiscard]] virtual std::span<const Index> coordinates() const = 0;
  /// False for a plain node, whose rotation no joint may use (jacobian() then has zero rotation rows).
  [[nodiscard]] virtual bool has_rotation() const { return true; }
  /// Position and rotation; velocities and biases too where v is not empty.
  virtual void motion(ConstSpan q, ConstSpan v, FrameMotion& out) const = 0;
  /// J, 6 x nd column by column: [delta r; delta phi] = J dq, delta phi the spatial rotation increment (global axes).
  virtual void jacobian(ConstSpan q, double* j) const = 0;
  /// out = J^T c for `count` vectors c of 6 numbers, one after the other; out: count x nd. `motion` is what motion()
  /// gave at the same q. The default multiplies with jacobian().
  virtual void project(ConstSpan q, const FrameMotion& motion, const double* c, int count, double* out) const;
  /// d(J v)/dq at constant v, 6 x nd column by column; overwrites. Zero by default (constant J).
  virtual void rate_jacobian(ConstSpan q, ConstSpan v, double* jv) const;
  /// False if coordinate k of the list never turns the frame (its column of J has no rotation part).
  [[nodiscard]] virtual bool turns(std::size_t /*k*/) const { return true; }
  /// False if J does not depend on q, so that wrench_stiffness() adds nothing.
  [[nodiscard]] virtual bool has_wrench_stiffness() const { return false; }
  /// Adds scale * d(J^T wrench)/dq (nd x nd, column by column) for a wrench [force; moment] held constant in global
  /// axes. Zero for frames whose J is constant.
  virtual void wrench_stiffness(ConstSpan q, const Vec6& wrench, double scale, double* k) const;
  /// Some columns of J^T C + d(J^T wrench)/dq.
  struct TangentColumns {
    std::size_t first, count;  ///< columns, by the coordinates of the list
    const double* c;           ///< these columns of C: 6 x count, column by column
    const double* twists;      ///< these columns of J: 6 x count; read where the wrench is not zero
    Vec6 wrench;               ///< [force; moment], held constant in global axes
  };
  /// Overwrites out (nd x count, column by column). The default makes J and the whole of wrench_stiffness(): for frames
  /// of few coordinates. May be called by many threads at a time.
  virtual void tangent_columns(ConstSpan q, const TangentColumns& columns, double* out) const;
};

/// A frame at rest in the global system.
class GroundFrame final : public Frame {
 public:
  explicit GroundFrame(const Vec3& r = Vec3::Zero(), const Mat3& rot = Mat3::Identity()) : r_(r), rot_(rot) {}
  [[nodiscard]] std::span<const Index> coordinates() const override { return {}; }
  void motion(ConstSpan q, ConstSpan v, FrameMotion& out) const override;
  void jacobian(ConstSpan q, double* j) const override;

 private:
  Vec3 r_;
  Mat3 rot_;
};

}  // namespace espalier::dynamics

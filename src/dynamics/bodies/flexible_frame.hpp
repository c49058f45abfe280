/// \file
/// Frames on flexible bodies, for joints and forces: nodes, averaged faces, beam nodes.
#pragma once

#include <memory>
#include <vector>

#include "dynamics/bodies/flexible_body.hpp"
#include "dynamics/dae/frame.hpp"

namespace espalier::dynamics {

/// One vertex of a flexible body that a frame depends on.
struct FrameVertex {
  Index vertex = 0;
  double weight = 0;        ///< share of the vertex in the origin; the weights of a frame add up to 1
  Vec3 arm = Vec3::Zero();  ///< B_a: the frame's rotation is the polar rotation of A = sum_a x_a B_a^T
};

/// The frame r = sum w_a x_a, rotation R from the polar decomposition A = R U of A = sum x_a B_a^T, times fixed axes.
/// With G = tr(U) I - U the angular velocity in turned axes is G^-1 sum B_a x R^T v_a (from R^T dA - dA^T R). All arms
/// zero: a frame without rotation. The body must outlive the frame.
class FlexibleFrame final : public Frame {
 public:
  /// @param axes columns: the frame's axes in the reference state, global components
  FlexibleFrame(const FlexibleBody& body, std::vector<FrameVertex> vertices, const Mat3& axes = Mat3::Identity());

  [[nodiscard]] const std::vector<FrameVertex>& vertices() const { return vertices_; }
  [[nodiscard]] const Mat3& axes() const { return axes_; }
  [[nodiscard]] std::span<const Index> coordinates() const override;
  [[nodiscard]] bool has_rotation() const override { return has_rotation_; }
  void motion(ConstSpan q, ConstSpan v, FrameMotion& out) const override;
  void jacobian(ConstSpan q, double* j) const override;
  void project(ConstSpan q, const FrameMotion& motion, const double* c, int count, double* out) const override;
  void rate_jacobian(ConstSpan q, ConstSpan v, double* jv) const override;
  [[nodiscard]] bool turns(std::size_t k) const override { return vertices_[k / 3].arm != Vec3::Zero(); }
  [[nodiscard]] bool has_wrench_stiffness() const override { return has_rotation_; }
  void wrench_stiffness(ConstSpan q, const Vec6& wrench, double scale, double* k) const override;
  void tangent_columns(ConstSpan q, const TangentColumns& columns, double* out) const override;

 private:
  /// How a fit changes when a vertex moves: turn and change of U, in the axes of the frame.
  struct Derivative {
    Vec3 phi;
    Mat3 stretch;
  };
  struct Fit {
    Mat3 rotation, stretch, inverse_g;
    /// Times B_a: the force on vertex a that a moment makes, R (c x B_a) with G c = R^T moment.
    [[nodiscard]] Mat3 force_of(const Vec3& moment) const;
    /// For the motion of vertex b along global axis j.
    [[nodiscard]] Derivative derivative(const FrameVertex& b, int j) const;
    /// Times B_a: how force_of() a constant moment changes with that motion. The moment is given in the axes of the
    /// frame, with c = G^-1 moment.
    [[nodiscard]] Mat3 change_of_force(const FrameVertex& b, int j, const Vec3& moment, const Vec3& c) const;
  };
  /// Angular velocity and sum t B^T with t = R^T v, in the axes of the frame.
  struct Turning {
    Vec3 omega;
    Mat3 rate;
  };
  [[nodiscard]] Turning turning(const Fit& f, ConstSpan v) const;
  [[nodiscard]] Vec3 at(ConstSpan values, Index first, Index vertex) const;
  [[nodiscard]] Fit fit(ConstSpan q) const;
  [[nodiscard]] Fit fit_or_none(ConstSpan q) const;

  const FlexibleBody& body_;
  std::vector<FrameVertex> vertices_;
  Mat3 axes_;
  bool has_rotation_ = false;
  mutable std::vector<Index> coordinates_;  // filled at the first call, when the body has its place
};

/// A node: position only.
std::unique_ptr<FlexibleFrame> make_node_frame(const FlexibleBody& body, Index node);

/// The average of a face set: every face gives its reference area in equal parts to its nodes. Its rotation couples all
/// nodes of the set in the tangent (a dense block), so sets should stay below some hundred nodes.
/// @throws std::invalid_argument on an empty set or one whose nodes lie on a line
std::unique_ptr<FlexibleFrame> make_face_frame(const FlexibleBody& body, const Mesh& mesh,
                                               std::span<const MeshFace> faces, const Mat3& axes = Mat3::Identity());

/// A node of a beam body: rotation of the cross-section (polar rotation of r_y, r_z). @pre vertices_per_node() == 4
std::unique_ptr<FlexibleFrame> make_beam_frame(const FlexibleBody& body, Index node,
                                               const Mat3& axes = Mat3::Identity());

}  // namespace espalier::dynamics

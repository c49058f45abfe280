/// \file
/// A flexible body reduced to a few shapes, in a floating frame of reference.
#pragma once

#include "dynamics/bodies/reduced_inertia.hpp"
#include "dynamics/bodies/rotation.hpp"
#include "dynamics/dae/capabilities.hpp"

namespace espalier::dynamics {

/// Node a is at x_a = r + R (X_a + sum_k phi_ak eta_k): any rigid motion, small strain. r is the centre of mass of the
/// body at rest, R turns the axes of the mesh; the shapes are orthogonal to rigid motion in the mass of the mesh, which
/// makes r the centre of mass of the strained body, too, and R its mean axes (Tisserand's).
/// Configuration: r, a unit quaternion, eta (7 + n numbers). Velocities: that of r in global axes, omega in body axes,
/// the rates of eta (6 + n).
///
/// The equations are those of the nodal body with its consistent mass, M = m_ab I, projected on these motions; nothing
/// of the inertia is left out (A. A. Shabana, "Dynamics of Multibody Systems", chapter 5; R. Schwertassek, O. Wallrapp,
/// "Dynamik flexibler Mehrkoerpersysteme", 1999). With u = X + phi eta, D_k = sum m_ab phi_ak u_b^T, A_k = tr(D_k) I -
/// D_k, c_k = sum m_ab u_a x phi_bk, U = sum m_ab u_a u_b^T, J = tr(U) I - U:
///   m (r'' - g)                                                              = 0
///   J alpha + omega x J omega + sum_k c_k eta_k'' + 2 sum_k eta_k' A_k omega = 0
///   m_k eta_k'' + c_k . alpha - omega . A_k omega + 2 omega . c_k' + k_k eta_k = 0
/// and damping. D is linear in eta, so the 9 n^2 numbers sum m_ab phi_ak phi_bl^T and the 9 n of sum m_ab phi_ak X_b^T
/// say all of it.
class ReducedBody final : public Component, public Curved, public Remembers {
 public:
  /// @param modal_damping ratio of critical damping of each shape
  ReducedBody(std::unique_ptr<NodalBody> nodal, ReducedBasis shapes, ReducedInertia inertia, double modal_damping);

  // Settings; all before the first evaluation.
  void set_damping(const RayleighDamping& damping) { damping_ = damping; }
  [[nodiscard]] const RayleighDamping& damping() const { return damping_; }
  void set_gravity(const Vec3& gravity) { gravity_ = gravity; }
  /// As FlexibleBody::set_initial_motion().
  void set_initial_motion(const Mat3& rotation, const Vec3& translation, const Vec3& velocity,
                          const Vec3& angular_velocity);

  /// The mesh, which is no part of the system of this body.
  [[nodiscard]] const FlexibleBody& nodal() const { return nodal_->body(); }
  [[nodiscard]] const ReducedBasis& shapes() const { return shapes_; }
  [[nodiscard]] Index modes() const { return static_cast<Index>(shapes_.mass.size()); }
  [[nodiscard]] double mass() const { return inertia_.mass; }
  /// All velocity coordinates; valid after place().
  [[nodiscard]] std::span<const Index> coordinates() const { return coordinates_; }

  [[nodiscard]] Vec3 position(ConstSpan q) const;
  [[nodiscard]] Quat quaternion(ConstSpan q) const;
  [[nodiscard]] Vec3 velocity(ConstSpan v) const;
  /// Angular velocity (or, given a, acceleration) in body axes.
  [[nodiscard]] Vec3 angular(ConstSpan v) const;
  [[nodiscard]] Eigen::Map<const Eigen::VectorXd> amplitudes(ConstSpan q) const;
  [[nodiscard]] Eigen::Map<const Eigen::VectorXd> rates(ConstSpan v) const;
  /// X_a + sum_k phi_ak eta_k of all vertices: the strained body in its own axes, at its place in the mesh.
  [[nodiscard]] std::vector<double> strained(ConstSpan q) const;
  /// Positions and velocities of all vertices, 3 each, global axes; `v` and `rate` may be empty.
  void nodal_motion(ConstSpan q, ConstSpan v, std::vector<double>& x, std::vector<double>& rate) const;
  [[nodiscard]] MassProperties mass_properties(ConstSpan q, ConstSpan v) const;
  [[nodiscard]] double strain_energy(ConstSpan q) const;

  // Component
  [[nodiscard]] Sizes sizes() const override { return {7 + modes(), 6 + modes(), 0}; }
  void place(const Placement& at) override;
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
  /// A few numbers that tell these shapes from others, so that a restart file is not read with other ones.
  void save(std::vector<double>& out) const override;
  void restore(ConstSpan& in) override;

 private:
  using Columns = Eigen::Map<const Eigen::Matrix<double, 9, Eigen::Dynamic>>;
  /// What the inertia of a strained state is made of.
  struct Inertia {
    Eigen::VectorXd d;          ///< D_k column by column, one after the other: 9 n
    Eigen::Matrix3Xd c;         ///< c_k
    Mat3 j = Mat3::Identity();  ///< J
  };
  [[nodiscard]] Inertia inertia(const Eigen::VectorXd& eta) const;
  /// sum_l U_kl x_l: D_k, but for its constant part.
  [[nodiscard]] Eigen::VectorXd couple(const Eigen::VectorXd& x) const { return inertia_.pairs * x; }
  void fill_velocity(const StateView& s, const TangentWeights& w, Eigen::MatrixXd& block) const;
  void fill_position(const StateView& s, const TangentWeights& w, Eigen::MatrixXd& block) const;

  std::unique_ptr<NodalBody> nodal_;
  ReducedBasis shapes_;
  ReducedInertia inertia_;
  Eigen::VectorXd viscous_;  // force per rate, of damping by ratio
  double length_;            // by which displacements are measured
  RayleighDamping damping_;
  Vec3 gravity_ = Vec3::Zero();
  Vec3 initial_position_, initial_velocity_ = Vec3::Zero(), initial_angular_ = Vec3::Zero();
  Quat initial_rotation_{1, 0, 0, 0};
  std::vector<Index> coordinates_;
  std::array<Offset, 3> mass_position_{};
  std::vector<Offset> block_start_;  // of columns of rotation and amplitudes in W; their rows follow each other
};

}  // namespace espalier::dynamics

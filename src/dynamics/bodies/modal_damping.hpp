/// \file
/// Damping by ratios of the modes of a whole model.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "dynamics/bodies/flexible_body.hpp"
#include "dynamics/bodies/reduced_body.hpp"
#include "dynamics/dae/assembled_system.hpp"
#include "dynamics/dae/equations.hpp"

namespace espalier::dynamics {

/// Flexible bodies are damped by forces F = sum_l g_l (2 / w_l^3) (g_l . v), where g_l = sqrt(ratio_b) K_b phi_l are
/// the elastic forces of mode l of the supported, undamped model in body b, and phi_l^T M phi_l = 1. Where all
/// stiffness is that of bodies of one ratio, K phi_l = w_l^2 M phi_l, and this is modal damping, C = sum_l 2 ratio w_l
/// (M phi_l) (M phi_l)^T: each mode has the ratio, and none is coupled to others. Else a mode has about the ratio times
/// the share of the bodies in its energy (composite damping: N. F. Roberts, in R. R. Craig, A. J. Kurdila,
/// "Fundamentals of Structural Dynamics", 2006, section 10.3). Elastic forces do no work in rigid motion, so that is
/// not damped. They turn with their bodies: amplitudes of reduced bodies are in their own axes, nodes are turned back
/// by the mean rotation.
class ModalDamping final : public Component, public Remembers {
 public:
  explicit ModalDamping(std::string name) : Component(std::move(name)) {}
  // Bodies to be damped; before the system is finished.
  void add(FlexibleBody& body, double ratio) { nodal_.push_back({&body, ratio, 0}); }
  void add(ReducedBody& body, double ratio) { reduced_.push_back({&body, ratio, 0}); }
  /// The coordinates of all of them. @pre they are placed
  [[nodiscard]] Index coordinates() const;

  /// Sets the forces from modes at a state: `shapes` has a column of all velocity coordinates of the system for each,
  /// with a modal mass of 1; `squares` are those of their angular frequencies. Modes without stiffness do not count.
  void set(AssembledSystem& system, const State& state, const Eigen::VectorXd& squares, const Eigen::MatrixXd& shapes);

  // Component
  [[nodiscard]] Sizes sizes() const override { return {}; }
  void declare(PatternBuilder& w, PatternBuilder& phi_q) const override;
  void bind(const SparsePattern& w, const SparsePattern& phi_q) override;
  void residual(const StateView& s, Span f) override;
  void tangent(const StateView& s, const TangentWeights& weights, Span w_values) override;
  void save(std::vector<double>& out) const override;
  void restore(ConstSpan& in) override;

 private:
  template <class Body>
  struct Damped {
    Body* body;
    double ratio;
    Eigen::Index first;  // row of its first coordinate
  };
  [[nodiscard]] std::vector<Index> list() const;
  /// The rotation of each nodal body since set().
  [[nodiscard]] std::vector<Eigen::Matrix3d> turns(ConstSpan q) const;
  void turn_nodes(const std::vector<Eigen::Matrix3d>& by, bool back, Eigen::VectorXd& x) const;

  std::vector<Damped<FlexibleBody>> nodal_;
  std::vector<Damped<ReducedBody>> reduced_;
  std::vector<Index> coordinates_;
  Eigen::MatrixXd forces_;     // columns g_l, by coordinates_
  Eigen::VectorXd factors_;    // 2 / w_l^3
  std::vector<double> rest_;   // configuration of set(), of the whole system
  std::vector<Offset> start_;  // of W: of the columns, and the rows in them
};

}  // namespace espalier::dynamics

/// \file
/// What reductions of bodies by fixed interfaces are made of.
#pragma once

#include <Eigen/Core>

#include "dynamics/bodies/reduction.hpp"
#include "dynamics/dae/assembled_system.hpp"

namespace espalier::dynamics::fixed_interfaces {

inline constexpr double kDependent = 1e-8;  ///< rows of interfaces that depend on others, relative

/// What a system that is this body alone has as its tangent in the body's reference state at rest.
[[nodiscard]] SparseMatrix reference_matrix(AssembledSystem& system, const FlexibleBody& body,
                                            const TangentWeights& weights);

[[nodiscard]] Eigen::MatrixXd product(const SparseMatrix& a, const Eigen::MatrixXd& x);

/// Motions of a body with its mass, and with the six rigid ones taken out of them.
class Rigid {
 public:
  /// @throws Error(invalid_input) for a body that has no inertia about an axis
  Rigid(const FlexibleBody& body, const SparseMatrix& mass, const std::string& name);
  /// Twice, against rounding.
  void remove_from(Eigen::MatrixXd& x) const;

  Vec3 centre;
  Eigen::MatrixXd motions;  ///< orthonormal in the mass

 private:
  const SparseMatrix& mass_;
};

/// Single coordinates that, together with the interfaces at rest, hold the body without straining it.
[[nodiscard]] Eigen::MatrixXd supports(const Eigen::MatrixXd& rows, const Eigen::MatrixXd& rigid);
/// Unit motions of each interface row with the others at rest, then loads with all at rest.
[[nodiscard]] Eigen::MatrixXd static_shapes(const SparseMatrix& stiffness, const Eigen::MatrixXd& rows,
                                            const Eigen::MatrixXd& held, const Eigen::MatrixXd& loads,
                                            const Options& solver);
/// The lowest modes with the rows at rest, orthonormal in the mass. @param free  how many of them are rigid motions
[[nodiscard]] Eigen::MatrixXd normal_modes(const SparseMatrix& mass, const SparseMatrix& stiffness,
                                           const Eigen::MatrixXd& rows, Index free, const ReductionOptions& options,
                                           const Options& solver);
/// Signs, and the directions of shapes that share a frequency, are left open by an eigenvalue problem. Here they follow
/// from fixed weights of the nodes, so that they do not jump with a parameter of the mesh, nor with rounding: in each
/// group, shape i has none of the weights 0 to i - 1 and a positive share of weight i.
void make_unique_basis(const Eigen::VectorXd& squares, Eigen::MatrixXd& shapes);

}  // namespace espalier::dynamics::fixed_interfaces

/// \file
/// Craig-Bampton reduction: the few shapes that a flexible body keeps.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "dynamics/bodies/flexible_frame.hpp"
#include "dynamics/dae/assembled_system.hpp"
#include "espalier/solver.hpp"

namespace espalier::dynamics {

/// What is kept of a flexible body.
struct ReductionOptions {
  /// So many modes with the interfaces at rest, beside those of the interfaces themselves. Infinite: no bound.
  double modes = std::numeric_limits<double>::infinity();
  double frequency = std::numeric_limits<double>::infinity();  ///< only those below this one, Hz
  double damping = 0;                                          ///< of each shape, as a ratio of critical damping
};

/// Shapes of small strain of a body at rest in its reference state. They are orthogonal in the mass and in the
/// stiffness of the mesh, and to the six rigid motions; the largest displacement of a node is 1 in each.
struct ReducedBasis {
  Eigen::MatrixXd shapes;           ///< 3 numbers for every vertex; columns rise by frequency
  Eigen::VectorXd mass, stiffness;  ///< of each shape; stiffness / mass is the square of its angular frequency
  Eigen::Vector3d centre;           ///< of mass, in the axes of the mesh
  Index from_interfaces = 0;        ///< how many of them are due to interfaces and loads; the others to modes
};

/// A flexible body by itself, at the beginning of a system of its own: the nodal truth behind a reduced body.
class NodalBody {
 public:
  explicit NodalBody(std::unique_ptr<FlexibleBody> body);
  [[nodiscard]] FlexibleBody& body() const { return *body_; }
  /// Mass or stiffness in the reference state, both triangles.
  [[nodiscard]] SparseMatrix mass() { return matrix({1, 0, 0}); }
  [[nodiscard]] SparseMatrix stiffness() { return matrix({0, 0, 1}); }

 private:
  [[nodiscard]] SparseMatrix matrix(const TangentWeights& weights);
  AssembledSystem system_;
  FlexibleBody* body_;
};

/// Static answers to unit motions of the interfaces (mean displacement and rotation of a frame's nodes) and to loads
/// with the interfaces at rest, and the lowest modes with the interfaces at rest: R. R. Craig, M. C. C. Bampton,
/// "Coupling of substructures for dynamic analyses", AIAA Journal 6, 1968. What is left beside rigid motion is made
/// orthogonal in mass and stiffness. A body without interfaces keeps its free modes.
/// @param interfaces frames on the body; those that depend on each other count once
/// @param loads force vectors, 3 numbers for every vertex
/// @throws Error(invalid_input) for a body that has no inertia about an axis, or shapes without stiffness; what the
/// solver reports
[[nodiscard]] ReducedBasis reduce(NodalBody& nodal, std::span<const FlexibleFrame* const> interfaces,
                                  const Eigen::MatrixXd& loads, const ReductionOptions& options, const Options& solver);

}  // namespace espalier::dynamics

/// \file
/// Craig and Bampton's reduced matrices, as other programs take them: in motions of interfaces and amplitudes of modes.
#pragma once

#include "dynamics/bodies/reduction.hpp"

namespace espalier::dynamics {

/// x = shapes [b; eta]: b the motions of the interfaces (three displacements and, where a frame has axes, three
/// rotations, along global axes), eta the amplitudes of modes with the interfaces at rest.
struct CraigBampton {
  Eigen::MatrixXd shapes;           ///< 3 numbers for every vertex; a column for each of b, then of eta
  Eigen::MatrixXd mass, stiffness;  ///< symmetric; modes have mass 1, and no stiffness with anything else
  Eigen::VectorXd squares;          ///< of the modes' angular frequencies, rising; those of rigid motion are 0
};

/// R. R. Craig, M. C. C. Bampton, "Coupling of substructures for dynamic analyses", AIAA Journal 6, 1968. Nothing is
/// taken out: rigid motion is part of b, or, where the interfaces leave it free, of the modes.
/// @param mass, stiffness of the body in its reference state, both triangles
/// @param names of the interfaces, for messages
/// @throws Error(invalid_input) for no interface, for interfaces that depend on each other, for neither a number of
/// modes nor a frequency
[[nodiscard]] CraigBampton craig_bampton(const FlexibleBody& body, const SparseMatrix& mass,
                                         const SparseMatrix& stiffness,
                                         std::span<const FlexibleFrame* const> interfaces,
                                         std::span<const std::string> names, const ReductionOptions& options,
                                         const Options& solver);

}  // namespace espalier::dynamics

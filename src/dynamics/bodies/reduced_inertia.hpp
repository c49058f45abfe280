/// \file
/// What the inertia of a reduced body is made of.
#pragma once

#include "dynamics/bodies/reduction.hpp"

namespace espalier::dynamics {

/// Sums over all mass points a, b of a body with places X (from its centre of mass) and shapes phi_k, in its own axes.
/// For a body without a mesh they are what its mass matrix says of them (substructure.hpp).
struct ReducedInertia {
  double mass = 0;
  Mat3 rest = Mat3::Zero();  ///< sum m_ab X_a X_b^T
  Eigen::VectorXd first;     ///< sum m_ab phi_ak X_b^T, column by column, one after the other: 9 n
  Eigen::MatrixXd pairs;     ///< sum m_ab phi_ak phi_bl^T in rows 9 k to 9 k + 8 of column l: 9 n x n
};

/// The integrals of a mesh with its consistent mass.
[[nodiscard]] ReducedInertia inertia_of_mesh(const FlexibleBody& body, const ReducedBasis& shapes);

}  // namespace espalier::dynamics

/// \file
/// The equations linearised at a state: mass, damping and stiffness, with the constraints as a border.
#pragma once

#include <vector>

#include "dynamics/dae/equations.hpp"
#include "espalier/matrix.hpp"

namespace espalier::dynamics {

/// F_a, F_v and (F + Phi_q^T lambda)_q at a state, n x n, general storage, symmetric or not.
struct TangentMatrices {
  SparseMatrix mass, damping, stiffness;
};
[[nodiscard]] TangentMatrices tangent_matrices(System& system, const State& state);

/// Constraint equations that are not left out, ascending.
[[nodiscard]] std::vector<Index> kept_constraints(const Equations& equations);

/// M x'' + D x' + K x = f for small motions x = [dq; dlambda] about a state of rest, n + r unknowns: the three
/// matrices, in K bordered by the rows of Phi_q that are kept and by their transpose with F_lambda. General storage.
struct Linearised {
  SparseMatrix mass, damping, stiffness;
  Index n = 0;              ///< velocity coordinates
  std::vector<Index> rows;  ///< r constraint equations that are kept: multiplier k is that of rows[k]
  [[nodiscard]] Index size() const { return n + static_cast<Index>(rows.size()); }
};
[[nodiscard]] Linearised linearise(Equations& equations, const State& state);

/// The symmetric part of A as a lower triangle, bordered by rows of constraints; every entry twice, halved, which is
/// summed up by whoever reads it.
[[nodiscard]] SparseMatrix bordered(const SparseMatrix& a, const SparsePattern& phi, ConstSpan values,
                                    const std::vector<Index>& rows);

}  // namespace espalier::dynamics

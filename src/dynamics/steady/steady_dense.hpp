/// \file
/// All modes of a steady motion of few coordinates.
#pragma once

#include <Eigen/Core>
#include <complex>
#include <optional>
#include <vector>

#include "dynamics/steady/steady_pencil.hpp"

namespace espalier::dynamics {

struct SteadyPair {
  std::complex<double> eigenvalue;  ///< of a conjugate pair the one above the real axis
  Eigen::VectorXcd xi;              ///< n
};

/// All of them, in no order. Constraints are eliminated: xi = Z a in the null space of the holonomic ones, a' = Y u - P
/// a with Y that of the others, and the equations of motion in the directions that no multiplier acts on. What is left
/// is a matrix of order 2 n - 2 m_holonomic - m_others in (a, u) without infinite eigenvalues. Its eigenvalues of zero
/// (motions that nothing resists) stand in chains, which rounding would spread: they are split off by null spaces,
/// one after the other (V. Kublanovskaya, USSR Comput. Math. Math. Phys. 6, 1966), before the QR algorithm finds the
/// others. O(n^3)
/// @return none where masses are missing, so that there are infinite ones
std::optional<std::vector<SteadyPair>> dense_steady_pairs(const SteadyPencil& p);

}  // namespace espalier::dynamics

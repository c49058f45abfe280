/// \file
/// Statics of small displacements: one solve with stiffness, loads and constraints as they are where the model stands.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "dynamics/dae/equations.hpp"

namespace espalier::dynamics {

struct LinearStatics {
  std::vector<double> dq;      ///< n: increment of the configuration
  std::vector<double> lambda;  ///< m: multipliers
  double residual = 0;         ///< largest entry of what is out of balance
  double backward_error = 0;   ///< largest |b - K x|_i / (|b| + |K| |x|)_i (Oettli and Prager 1964)
  /// What rounding in the stiffness itself may change of dq, relatively. Thin parts lose their bending in it, and no
  /// solve gives that back.
  double rounding = 0;
  std::string softest;  ///< coordinate that moves most
  int factorizations = 0;
};

/// Solves K [dq; lambda] = -[F(q0; load); Phi(q0)] with K = [F_q, Phi_q^T + F_lambda; Phi_q, 0] at q0 and load factor
/// 0: loads keep direction and place, and the answer goes with them. With refinement.
/// @param start v and a zero @param stiff called once the load factor is 0, before K is made: forces that are functions
/// of the state are stiff by their loads @param hidden n, or none: stiffness that elements have summed away before K
/// sees it, but for its rounding
/// @throws espalier::Error, singular: names what nothing holds; invalid_input: a constraint left out contradicts others
[[nodiscard]] LinearStatics linear_statics(Equations& equations, const State& start, double load,
                                           const std::function<void()>& stiff, const std::vector<double>& hidden = {});

}  // namespace espalier::dynamics

/// \file
/// Finite-difference check of everything a system claims about its derivatives.
#pragma once

#include <string>

#include "dynamics/dae/equations.hpp"

namespace espalier::dynamics {

/// Largest differences between what the system states and central differences, each relative to the largest entry of
/// the matrix concerned (or 1). `worst` names the entry of the largest one.
struct JacobianCheck {
  double f_a = 0;    ///< dF/da
  double f_v = 0;    ///< dF/dv
  double f_q = 0;    ///< d(F + Phi_q^T lambda)/dq
  double phi_q = 0;  ///< against Phi(q (+) dq, t)
  double nu = 0;     ///< against Phi(q, t + dt)
  double gamma = 0;  ///< against d/dt (Phi_q v - nu) along the motion
  double chart = 0;  ///< retract, local and velocity_of_rate against each other
  std::string worst;
  [[nodiscard]] double largest() const;
};

/// Checks at a state, which need not satisfy any equation. Costs O(n) evaluations; for n up to some thousands.
[[nodiscard]] JacobianCheck check_jacobians(System& system, const State& s);

}  // namespace espalier::dynamics

/// \file
/// Impulses with Coulomb friction of points that strike at one instant.
#pragma once

#include <Eigen/Core>

namespace espalier::dynamics::contact {

/// The impact of n points; three rows each: along the normal (the rate of the gap) and two tangents.
struct FrictionImpact {
  Eigen::MatrixXd w;            ///< 3n x 3n, velocity / impulse: rates that unit impulses make; symmetric, not negative
  Eigen::VectorXd before;       ///< 3n: rates before
  Eigen::VectorXd restitution;  ///< n, of the normal rates, in [0, 1]
  Eigen::VectorXd friction;     ///< n, Coulomb's coefficient
};

/// Impulses p (3n) with Newton's restitution along the normals and Coulomb's law for the tangential rates after the
/// impact (Moreau, in Nonsmooth Mechanics and Applications, CISM 302 (1988)), u = before + w p:
///   0 <= p_n, 0 <= u_n + r before_n^-, p_n (u_n + r before_n^-) = 0;  |p_t| <= mu p_n, u_t = 0 or p_t = -mu p_n u_t /
///   |u_t|
/// where before_n^- is before_n of a point that approaches, else 0. Projected steps of Gauss and Seidel. With
/// restitution and friction this may raise the energy p . (before + w p / 2) (Kane 1984): then all restitutions are
/// lowered by the largest common factor with which it does not.
[[nodiscard]] Eigen::VectorXd friction_impulses(const FrictionImpact& impact);

}  // namespace espalier::dynamics::contact

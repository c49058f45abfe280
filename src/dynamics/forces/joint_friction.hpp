/// \file
/// Coulomb and viscous friction in joints, from their reactions.
#pragma once

#include "dynamics/forces/coordinate_force.hpp"
#include "dynamics/forces/vector_function.hpp"

namespace espalier::dynamics {

/// Coefficient of friction over the slip speed s >= 0, made smooth at rest:
///   mu(s) = (dynamic + (a - dynamic) exp(-(s / stribeck_speed)^2)) tanh(s / slip_speed)
/// a is the static coefficient, or as much more as it takes for the largest mu to be that (stribeck_speed >=
/// slip_speed). (Andersson, Soederberg, Bjoerklund, Tribology International 40 (2007), eq. 7 with exponent 2). A body
/// that sticks creeps: where static N would hold a load of F, at about slip_speed atanh(F / (static N)).
struct FrictionCurve {
  double dynamic_coefficient = 0, static_coefficient = 0;
  double stribeck_speed = 1, slip_speed = 1;
};

/// mu(s) / s and its derivative over s, both finite at s = 0.
struct FrictionQuotient {
  double phi = 0, slope = 0;
};
[[nodiscard]] FrictionQuotient friction_quotient(const FrictionCurve& curve, double s);
/// The curve with its `a` for the static coefficient. @throws std::invalid_argument where speeds are not positive, or a
/// coefficient is negative
[[nodiscard]] FrictionCurve checked_curve(const FrictionCurve& curve);

/// What presses the surfaces together, from force F and moment M of a joint on its frame B and the axis z of its frame
/// A: N = preload + radial |F - z z.F| + axial |z.F| + bending |M - z z.M| + torsion |z.M|. The weights take lever arms
/// into account (bending, torsion: one over a length).
struct FrictionLoad {
  double preload = 0, radial = 1, axial = 0, bending = 0, torsion = 0;
};

/// N as a number of the state. The joint must outlive it.
[[nodiscard]] StateFunctionPtr friction_load(const Joint& joint, const FrictionLoad& load);

/// preload + |F|, F the force of the joint on its frame B.
[[nodiscard]] StateFunctionPtr friction_load_of_force(const Joint& joint, double preload);
/// preload + factor |lambda|, lambda the multiplier of a row.
[[nodiscard]] StateFunctionPtr friction_load_of_row(const Joint& joint, std::size_t row, double factor, double preload);

/// Friction along a relative coordinate g whose slip speed is u = radius g' (radius 1: a displacement):
///   s = radius N mu(|slip|) u / |slip| + viscous g'
/// Input 0 is N; input 1, if there is one, the slip speed w across u: |slip| = sqrt(u^2 + w^2), else |u|.
struct FrictionLaw {
  FrictionCurve curve;
  double radius = 1;
  double viscous = 0;
};
/// @throws std::invalid_argument where speeds or radius are not positive, or a coefficient is negative
[[nodiscard]] std::unique_ptr<CoordinateLaw> friction_law(const FrictionLaw& law);

/// factor * y
[[nodiscard]] StateFunctionPtr scaled(StateFunctionPtr y, double factor);

}  // namespace espalier::dynamics

/// \file
/// Impacts that take no time: velocities jump, positions stay.
#pragma once

#include <array>
#include <vector>

#include "dynamics/contact/law.hpp"
#include "dynamics/dae/equations.hpp"

namespace espalier::dynamics::contact {

/// What is rounding in the rate of a gap, over the sum of the magnitudes of its parts.
constexpr double kRateRounding = 1e-11;

/// A place where two bodies touch at the instant of an impact.
struct ImpactPoint {
  std::string surfaces;  ///< both names, for messages
  ContactLaw law;
  bool closed = true;  ///< the gap is not above zero
  bool held = false;   ///< by the spring of the law already
  /// Gradient of the gap: coordinates of v, and derivatives by them.
  std::vector<Index> coordinates;
  std::vector<double> gap_by;
  /// With friction: of the slip of the second body along two tangents, by the same coordinates.
  std::array<std::vector<double>, 2> slip_by;
  // What solve_impact() finds
  double impulse = 0;  ///< along the normal, not negative
  bool rests = false;  ///< it stays closed from now on
  double damping = 0;  ///< c of its spring: critical for the mass that the two bodies have for each other there
};

/// Changes the velocities of a state by impulses l >= 0 along the normals of the points, and by those of the joints:
///   M dv + Phi_q^T L = G^T l,  Phi_q dv = 0   (K with W = M; G: gradients of the gaps)
/// Impacts at one instant go in rounds (generalized reflections: Smith, Kaufman, Vouga, Tamstorf, Grinspun, ACM Trans.
/// Graph. 31 (2012) 106). The points that approach get the impulses p after which none of them does,
///   0 <= p, 0 <= G (v + dv), p . G (v + dv) = 0,
/// times 1 + restitution (of points that act on each other: the smallest), so that what met with u parts with r u.
/// Where one of them has friction: those of friction_impulses() instead. Then others may approach, and so on. A round
/// does not raise the energy. After 100 rounds, what still approaches stops.
///
/// A point that meets so slowly that it would not rise by half of what it sinks at rest has the restitution 0, and
/// stays closed: u^2 / (2 a) < m a / (2 k), a its acceleration towards the other body, 1 / m = G K^-1 G^T, k the law's
/// slope there. So bounces come to an end.
/// @param state consistent; v is changed, a and lambda do not fit any more. Factorizes K.
/// @throws Error(invalid_input) where bodies that cannot move apart strike
void solve_impact(Equations& equations, State& state, std::vector<ImpactPoint>& points);

}  // namespace espalier::dynamics::contact

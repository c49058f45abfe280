/// \file
/// Small motions about a steady motion: spinning and rolling bodies, with gyroscopic and centrifugal terms.
#pragma once

#include <optional>
#include <string>

#include "dynamics/integrators/vibrations.hpp"
#include "dynamics/steady/vector_coordinates.hpp"

namespace espalier::dynamics {

/// One mode of a steady motion.
struct SteadyMode {
  Mode mode;                      ///< as seen from the axes chosen
  double whirl = 0;               ///< see SimulationMode
  double standing_frequency = 0;  ///< see SimulationMode
};

struct SteadyModes {
  std::vector<SteadyMode> modes;  ///< by modulus, one of each conjugate pair, one for a motion without resistance;
                                  ///< none: the motion is not steady
  Vec3 rate = Vec3::Zero();       ///< angular velocity of the axes from which the motion is steady
  std::string notice;             ///< from which axes the motion is seen; what is not exact
};

/// The `count` slowest small motions x about a motion that is steady as seen from axes that turn with a constant rate
/// w_f: at rest (spinning rotors in bearings, vehicles on a straight way), or with one of the bodies (blades and what
/// else turns as one). Vectors are held in these axes, increments of rotations as spatial ones; then with S their
/// axes, xi = S x, and the angular velocity W of a body
///   S dv = xi' + w_f x xi,    S da = (S dv)' + (w_f - W) x (S dv) of turns, (S dv)' + w_f x (S dv) of other vectors
/// M da + D dv + K x + (Phi_q^T + F_lambda) dlambda = 0 becomes a quadratic problem in xi, with Phi_q x = 0 of
/// holonomic constraints and Phi_q dv + (Phi_q v - nu)_q x = 0 of the others.
///
/// That its coefficients are constant is measured, by the response to forces in these axes a little before and after.
/// @param state  consistent: velocities, accelerations, multipliers; left at it
/// @throws Error where modes cannot be found
SteadyModes steady_modes(Equations& equations, const AssembledSystem& system, const State& state, Index count,
                         const Options& solver);

}  // namespace espalier::dynamics

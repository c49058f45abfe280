/// \file
/// Eight-node hexahedra with assumed or enhanced Green-Lagrange strains: no locking, frame-indifferent, exact tangent.
///
/// All formulations replace the compatible strain E(u) by a field that vanishes under rigid motion and lives in the
/// material frame, so frame indifference is kept to round-off. Enhanced parameters are eliminated element by element:
/// evaluate() solves for them (one linear solve for St. Venant-Kirchhoff, Newton's method for neo-Hookean) and
/// condenses the tangent, so the element stays a function of its nodal positions alone.
#pragma once

#include "base/named.hpp"
#include "dynamics/elements/element.hpp"
#include "dynamics/elements/material.hpp"

namespace espalier::dynamics {

enum class Hex8Formulation {
  /// Compatible strains, 2 x 2 x 2 points: locks in bending and near incompressibility.
  full,
  /// Volumetric strain replaced by its element mean (B-bar; Hughes 1980; C3D8 of Abaqus at small strain): no
  /// volumetric locking, still stiff in bending.
  mean_dilatation,
  /// Nine enhanced strain parameters (Andelfinger and Ramm 1993, EAS-9; Klinkel and Wagner 1997 for finite
  /// strains): exact bending of parallelepipeds of any aspect ratio. Locks on thin curved shells, whose elements are
  /// trapezoids (use shell), and may show hourglass modes under strong compression (Wriggers and Reese 1996).
  enhanced,
  /// Thin in the direction from face 1 (nodes 1-4) to face 2 (nodes 5-8): transverse shear strains interpolated from
  /// mid-edges (Bathe and Dvorkin 1985), thickness strain from the corner lines (Betsch and Stein 1995), four
  /// in-plane and four thickness enhanced parameters (Vu-Quoc and Tan 2003). For plates and shells, flat or curved.
  shell,
};
inline constexpr base::Named<Hex8Formulation> kHex8Formulations[] = {
    {"full", Hex8Formulation::full},
    {"mean-dilatation", Hex8Formulation::mean_dilatation},
    {"enhanced", Hex8Formulation::enhanced},
    {"shell", Hex8Formulation::shell}};

/// Internal force, tangent and energy of one hex8. @return false when a point has turned inside out, or when Newton's
/// method for the enhanced parameters fails (output undefined)
[[nodiscard]] bool evaluate_hex8(Hex8Formulation formulation, const Material& material, const ElementInput& in,
                                 ElementOutput& out);

/// The strains that the element assumes at its integration points, with the enhanced parameters of its equilibrium.
/// @return as evaluate_hex8()
[[nodiscard]] bool sample_hex8(Hex8Formulation formulation, const Material& material, const double* reference,
                               const double* position, ElementSamples& out);

}  // namespace espalier::dynamics

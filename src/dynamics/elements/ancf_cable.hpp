/// \file
/// ANCF cable (thin beam without shear or torsion) after Gerstmayr and Irschik, "On the correct representation of
/// bending and axial deformation in the absolute nodal coordinate formulation with an elastic line approach",
/// J. Sound Vib. 318 (2008) 461-487.
#pragma once

#include "dynamics/elements/element.hpp"

namespace espalier::dynamics {

/// Section of a cable that is straight in its natural state.
struct CableSection {
  double axial = 0;            ///< E A
  double bending = 0;          ///< E I, the same in every direction
  double mass_per_length = 0;  ///< rho A
};

/// Vertices: r1, dr1/dx, r2, dr2/dx, x the arc length of the undeformed cable. Strains: eps = |r'| - 1 and
/// kappa = r' x r'' / |r'|^2 (the turning of the tangent per undeformed length). Axial part with 5, bending part with
/// 3 Gauss points. ElementInput::reference is not read: the natural state is straight and `length` long.
/// @return false when r' vanishes at a point (output undefined)
[[nodiscard]] bool evaluate_cable(const CableSection& section, double length, const ElementInput& in,
                                  ElementOutput& out);

/// N and the moment in global axes at -1, 0, 1 along the element, of strains that are made linear along it (least
/// squares): those of r' itself swing about them. @return as evaluate_cable()
[[nodiscard]] bool sample_cable(const CableSection& section, double length, const double* position,
                                ElementSamples& out);

/// Consistent mass, 4 x 4 (exact).
void cable_mass(const CableSection& section, double length, double* m);

}  // namespace espalier::dynamics

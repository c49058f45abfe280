/// \file
/// Fully parametrised ANCF beam: two nodes with position and all three gradient vectors, structural mechanics
/// formulation.
///
/// Kinematics: axis r(x) cubic (Hermite) in r and r_x, cross-section vectors r_y and r_z linear. Strains after
/// Nachbagauer, Gruber and Gerstmayr, "A 3D shear deformable finite element based on the absolute nodal coordinate
/// formulation", and "Structural and continuum mechanics approaches for a 3D shear deformable ANCF beam finite element"
/// (J. Comput. Nonlinear Dynam. 8 (2013)): axial, shear, torsion and bending strains of Simo and Vu-Quoc with the
/// orthonormal frame that follows the cross-section, plus the cross-section's own stretch and shear, integrated at
/// the nodes only. Section stiffnesses are free numbers, so torsion and shear factors can be right for any section.
#pragma once

#include "dynamics/elements/element.hpp"
#include "dynamics/elements/material.hpp"

namespace espalier::dynamics {

/// Stiffness and inertia of a cross-section; y and z are its principal axes, x the axis of the beam.
struct BeamSection {
  double axial = 0;            ///< E A
  double shear_y = 0;          ///< k_y G A, force along y
  double shear_z = 0;          ///< k_z G A, force along z
  double torsion = 0;          ///< G J
  double bending_y = 0;        ///< E I_y, I_y = integral of z^2: bending about y, deflection along z
  double bending_z = 0;        ///< E I_z, I_z = integral of y^2: bending about z, deflection along y
  double section_normal = 0;   ///< stiffness against stretch of r_y and of r_z (E A for a solid section)
  double section_shear = 0;    ///< stiffness against shear between r_y and r_z (G A)
  double mass_per_length = 0;  ///< rho A
  double inertia_y = 0;        ///< rho * integral of y^2 (rotary inertia of r_y)
  double inertia_z = 0;        ///< rho * integral of z^2
};

/// A rectangle of `height` along y and `width` along z. Shear factor 10 (1 + nu) / (12 + 11 nu) (Cowper 1966) in both
/// directions, torsion constant by Saint-Venant's series.
BeamSection rectangular_section(const Material& material, double height, double width);
/// A circle. Shear factor 6 (1 + nu) / (7 + 6 nu) (Cowper 1966).
BeamSection circular_section(const Material& material, double radius);

/// Vertices: r, r_x, r_y, r_z of node 1, then of node 2; r_x derivative by the arc length of the reference, r_y and
/// r_z of length 1 there. The reference (curved and twisted allowed) is free of stress. Six strains at 3 Gauss points
/// (forces) and 2 (moments), section strains at the nodes.
/// @return false when r_y and r_z become parallel or vanish (output undefined)
[[nodiscard]] bool evaluate_beam(const BeamSection& section, double length, const ElementInput& in, ElementOutput& out);

/// Consistent mass, 8 x 8 (exact).
void beam_mass(const BeamSection& section, double length, double* m);

}  // namespace espalier::dynamics

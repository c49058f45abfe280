/// \file
/// Stiffness and inertia of the cross-section of a beam.
#pragma once

#include "dynamics/elements/material.hpp"

namespace espalier::dynamics {

/// y and z are the principal axes of the section, x the axis of the beam.
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

}  // namespace espalier::dynamics

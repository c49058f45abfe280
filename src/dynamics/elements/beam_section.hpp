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

/// @param torsion  torsion constant @param shear  factor of both directions
BeamSection section_of(const Material& material, double area, double iy, double iz, double torsion, double shear);
/// A rectangle of `height` along y and `width` along z. Shear factor 10 (1 + nu) / (12 + 11 nu) (Cowper 1966) in both
/// directions, torsion constant by Saint-Venant's series.
BeamSection rectangular_section(const Material& material, double height, double width);
/// A tube. Shear factor 6 (1 + nu) (1 + m^2)^2 / ((7 + 6 nu) (1 + m^2)^2 + (20 + 12 nu) m^2), m = inner / outer radius
/// (Cowper 1966).
BeamSection tube_section(const Material& material, double outer, double wall);
/// A closed box of thin walls, `height` along y and `width` along z to the outside. The walls along a direction carry
/// the shear force along it; torsion by Bredt, J = 4 A^2 / sum(s / t) of the walls' middle lines.
struct BoxShape {
  double height = 0, width = 0;
  double wall_y = 0, wall_z = 0;  ///< of the two walls at its ends along y, and along z
};
BeamSection box_section(const Material& material, const BoxShape& shape);
/// An I whose web stands along y. The web carries the shear force along y, the flanges that along z; torsion of thin
/// strips, J = sum(s t^3) / 3, free to warp.
struct IShape {
  double height = 0, width = 0;  ///< along y, to the outside; of the flanges, along z
  double flange = 0, web = 0;    ///< thicknesses
};
BeamSection i_section(const Material& material, const IShape& shape);
/// A circle. Shear factor 6 (1 + nu) / (7 + 6 nu) (Cowper 1966).
BeamSection circular_section(const Material& material, double radius);

}  // namespace espalier::dynamics

/// \file
/// Fully parametrised ANCF beam: two nodes with position and all three gradient vectors, structural mechanics
/// formulation.
///
/// Coordinates and mass are those of the absolute nodal coordinate formulation: axis r(x) cubic (Hermite) in r and
/// r_x, cross-section vectors r_y and r_z linear, a constant mass matrix. Elasticity is that of the geometrically exact
/// beam (Reissner, Simo) on the rotations of the nodes (beam_strain.hpp), plus the cross-section's own stretch and
/// shear at the nodes, as in Nachbagauer, Gruber and Gerstmayr, "Structural and continuum mechanics approaches for a 3D
/// shear deformable ANCF beam finite element" (J. Comput. Nonlinear Dynam. 8 (2013)). A section's rotation is the polar
/// rotation of r_y and r_z, which is also what joints and loads turn: a moment on a node strains the beam, but never
/// the section. Section stiffnesses are free numbers, so torsion and shear factors can be right for any section.
#pragma once

#include "dynamics/elements/beam_section.hpp"
#include "dynamics/elements/element.hpp"

namespace espalier::dynamics {

/// Vertices: r, r_x, r_y, r_z of node 1, then of node 2; r_x derivative by the arc length of the reference, r_y and
/// r_z of length 1 there. The reference (curved and twisted allowed) is free of stress.
/// @return false when r_y and r_z become parallel or vanish, when the element is turned inside out (its chord points
/// backwards), or when it turns by a full circle (output undefined)
[[nodiscard]] bool evaluate_beam(const BeamSection& section, double length, const ElementInput& in, ElementOutput& out);

/// Section forces at -1, 0, 1 along the element, in the axes of the section: N, Qy, Qz, T, My, Mz, those that the part
/// ahead (along x) exerts on the part behind. @return as evaluate_beam()
[[nodiscard]] bool sample_beam(const BeamSection& section, double length, const double* reference,
                               const double* position, ElementSamples& out);

/// Consistent mass, 8 x 8 (exact).
void beam_mass(const BeamSection& section, double length, double* m);

}  // namespace espalier::dynamics

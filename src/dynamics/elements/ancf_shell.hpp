/// \file
/// ANCF shell: four nodes with position r and transverse gradient r_z, bilinear, shear deformable.
///
/// Kinematics of Yamashita, Valkeapaeae, Jayakumar and Sugiyama, "Continuum mechanics based bilinear shear deformable
/// shell element using absolute nodal coordinate formulation" (J. Comput. Nonlinear Dynam. 10 (2015) 051012):
/// x = sum_a N_a(xi, eta) (r_a + zeta h/2 d_a). That is a hex8 with nodes r_a -/+ h/2 d_a, so strains, locking
/// remedies and tangent are those of Hex8Formulation::shell, carried over by this linear map.
#pragma once

#include "dynamics/elements/element.hpp"
#include "dynamics/elements/material.hpp"

namespace espalier::dynamics {

/// Vertices: r1, d1, ..., r4, d4; the reference has |d_a| = 1 for a shell of thickness `thickness`, nodes
/// anticlockwise seen from the side that d points to.
/// @return false when a point has turned inside out (output undefined)
[[nodiscard]] bool evaluate_shell(const Material& material, double thickness, const ElementInput& in,
                                  ElementOutput& out);

/// The nodes of the hexahedron that a shell is: bottom, then top. @param shell, hex 24 numbers each
void shell_to_hexahedron(const double* shell, double thickness, double* hex);

/// As sample_hex8().
[[nodiscard]] bool sample_shell(const Material& material, double thickness, const double* reference,
                                const double* position, ElementSamples& out);

/// Consistent mass, 8 x 8 (2 x 2 x 2 points, exact for parallelograms).
void shell_mass(double density, double thickness, const double* reference, double* m);

}  // namespace espalier::dynamics

/// \file
/// Displacement-based solids (tet4, tet10, hex8, hex20, wedge6, wedge15), total Lagrangian.
///
/// Internal force and its exact tangent at finite displacements; see PointResponse for the algebra. The locking-free
/// hex8 is in hex8_strain.hpp.
#pragma once

#include "dynamics/elements/element.hpp"
#include "dynamics/elements/material.hpp"
#include "dynamics/elements/shape_functions.hpp"

namespace espalier::dynamics {

/// Internal force, tangent and energy of one solid of `type` (arrays as ElementInput and ElementOutput say).
/// @return false when the volume at an integration point is not positive (output undefined)
[[nodiscard]] bool evaluate_solid(ElementType type, Rule rule, const Material& material, const ElementInput& in,
                                  ElementOutput& out);

/// Its strains at the points of solid_samples(). @return as evaluate_solid()
[[nodiscard]] bool sample_solid(ElementType type, const double* reference, const double* position, ElementSamples& out);
/// Where the stresses of a displacement-based solid are best: the middle of tet4, the four points of tet10, and 2 x 2 x
/// 2 Gauss points of hexahedra, also of second order (J. Barlow, Int. J. Num. Meth. Engng. 10, 1976).
[[nodiscard]] SamplePoints solid_samples(ElementType type);

/// Consistent mass of one solid, nodes x nodes: integral of density * N_a * N_b, with Rule::mass, or with
/// Rule::stiffness where the element is folded at a point of the former: a negative volume there could make the matrix
/// indefinite, positive weights cannot.
void solid_mass(ElementType type, double density, const double* reference, double* m);

/// Smallest Jacobian determinants of an element in the reference state.
struct SmallestJacobian {
  double points = 0;   ///< over the points of Rule::stiffness: not positive for an inverted element
  double corners = 0;  ///< over the corners and Rule::mass: not positive where a quadratic element is folded there
};
SmallestJacobian smallest_jacobian(ElementType type, const double* reference);

}  // namespace espalier::dynamics

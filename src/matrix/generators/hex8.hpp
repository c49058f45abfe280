/// \file
/// The eight-node brick element with trilinear shape functions and 2 x 2 x 2 Gauss points (T. Hughes, "The Finite
/// Element Method", sections 3.5 and 3.8).
#pragma once

#include <array>

namespace espalier::matrix {

/// Corner c stands at (c & 1, c >> 1 & 1, c >> 2 & 1) of the reference cube.
using HexCorners = std::array<std::array<double, 3>, 8>;
/// Entry (3 a + i, 3 b + k) couples direction i at corner a with direction k at corner b. Row by row, exactly
/// symmetric.
using HexStiffness = std::array<double, 24 * 24>;
/// Entry (a, b) of the mass per direction. Row by row, exactly symmetric.
using HexMass = std::array<double, 8 * 8>;

/// Corners of a box with one corner at the origin.
HexCorners hex_box(double length_x, double length_y, double length_z);

/// Stiffness of linear isotropic elasticity. @param young E  @param poisson nu, in [0, 0.5)
/// @pre the Jacobian of `corners` is positive at the Gauss points
HexStiffness hex8_stiffness(const HexCorners& corners, double young, double poisson);

/// Consistent mass for density 1: integrals of N_a N_b. Same precondition.
HexMass hex8_mass(const HexCorners& corners);

}  // namespace espalier::matrix

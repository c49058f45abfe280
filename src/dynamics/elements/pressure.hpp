/// \file
/// Follower pressure on the face of a solid.
#pragma once

#include "dynamics/mesh/element_type.hpp"

namespace espalier::dynamics {

/// Force of a pressure (positive: towards the solid) on one face, integrated over the deformed area:
/// f_a = -p * integral of N_a (dx/dxi x dx/deta). `x` holds the current positions of the face's nodes, 3 each,
/// anticlockwise seen from outside; adds to f (3 per node).
void add_pressure_force(ElementType face, double pressure, const double* x, double* f);

/// Adds weight * df/dx to k (3 nodes x 3 nodes, column by column). Unsymmetric except for closed surfaces.
void add_pressure_tangent(ElementType face, double pressure, double weight, const double* x, double* k);

}  // namespace espalier::dynamics

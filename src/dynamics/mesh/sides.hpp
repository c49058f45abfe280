/// \file
/// Face sets for meshes that name no part of their surface.
#pragma once

#include "dynamics/mesh/mesh.hpp"

namespace espalier::dynamics {

/// Where no face set is a part of the surface (there are none, or each is all of it), adds the face sets x0, x1, y0,
/// y1, z0, z1: the outer faces at the two ends of the mesh in each direction, up to a thousandth of its extent from
/// there; where none lies so, up to a tenth; else the outermost face alone. Names that are taken are left as they are.
/// @return whether it did
bool add_side_sets(Mesh& mesh);

}  // namespace espalier::dynamics

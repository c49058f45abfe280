/// \file
/// Solids whose nodes are numbered the other way round.
#pragma once

#include <span>

#include "dynamics/mesh/mesh.hpp"

namespace espalier::dynamics {

/// Twice a measure of the volume of a solid at its centre, from its corners: negative where it is left-handed.
[[nodiscard]] double corner_volume(ElementType type, const std::vector<Point>& places, std::span<const Index> nodes);

/// Orders the nodes of a left-handed solid as those of its mirror image are. The other way round it does the same.
void turn_round(ElementType type, std::span<Index> nodes);

}  // namespace espalier::dynamics

/// \file
/// Faces of elements as triangles and outlines.
#pragma once

#include <array>
#include <vector>

#include "espalier/types.hpp"

namespace espalier::dynamics::page {

/// @param face  `corners` of them, then its mid-side nodes, if there are any
void add_triangles(const std::vector<Index>& face, std::size_t corners, std::vector<std::array<Index, 3>>& out);
/// Its sides, in halves where they have a node in the middle.
void add_outline(const std::vector<Index>& face, std::size_t corners, std::vector<std::array<Index, 2>>& out);
/// Each edge once, whichever way round.
void remove_repeats(std::vector<std::array<Index, 2>>& edges);

}  // namespace espalier::dynamics::page

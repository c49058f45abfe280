/// \file
/// Minimum degree on small graphs with a halo.
#pragma once

#include <span>
#include <vector>

#include "espalier/types.hpp"

namespace espalier::analysis {

/// A small graph whose first `inner` vertices are to be ordered; the others, its halo, are eliminated later and count
/// in the degrees only (Pellegrini, Roman, Amestoy 1999).
struct HaloGraph {
  Index inner = 0;
  std::vector<Index> weight;  ///< all vertices, the halo behind the inner ones
  std::vector<Index> ptr;     ///< inner + 1
  std::vector<Index> adj;     ///< ptr[inner]; neighbours of the inner vertices
};

/// Exact weighted external minimum degree, ties by index, on bit sets: O(inner * degree * size / 64) time, inner * size
/// / 8 bytes. Meant for up to a thousand vertices.
std::vector<Index> minimum_degree(const HaloGraph& graph);

}  // namespace espalier::analysis

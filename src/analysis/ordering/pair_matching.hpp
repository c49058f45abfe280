/// \file
/// Matchings of weighted graphs that prefer heavy edges.
#pragma once

#include <vector>

#include "analysis/ordering/coarsen.hpp"

namespace espalier::analysis {

/// mate[v]: the vertex that v is contracted with, itself for none. Vertices of low degree choose first, in random order
/// among equals, each the heaviest edge to a vertex that is left and with which it is at most `most_weight` heavy.
/// Small graphs are matched vertex by vertex; in large ones a part of the vertices chooses at the same time and of
/// those that want the same vertex the first gets it (deterministic reservations; Blelloch, Fineman, Gibbons, Shun
/// 2012): which way is taken and what comes out depend on the graph and the random state alone.
std::vector<Index> match_pairs(const PartGraph& graph, Offset most_weight, Random& random, base::Recursion& workers);

}  // namespace espalier::analysis

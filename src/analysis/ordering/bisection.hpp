/// \file
/// Two halves of a graph with few edges between them: where vertex separators start from on coarse graphs, whose
/// vertices are too big to measure a separator by, while their edges still count those of the finest graph.
#pragma once

#include <array>
#include <vector>

#include "analysis/ordering/coarsen.hpp"

namespace espalier::analysis {

struct Bisection {
  std::vector<char> side;          ///< n; 0 or 1
  std::array<Offset, 2> weight{};  ///< of the sides
  Offset cut = 0;                  ///< weight of the edges between them
};

/// Side 0 grows from a random vertex to half the weight, always by the vertex that cuts fewest edges.
Bisection grow_bisection(const PartGraph& graph, Random& random);

/// Passes of Fiduccia and Mattheyses (1982). @param most_side neither side is made heavier than that
void refine(const PartGraph& graph, Offset most_side, int passes, Bisection& bisection);

}  // namespace espalier::analysis

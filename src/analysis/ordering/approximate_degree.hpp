/// \file
/// Approximate minimum degree on whole graphs.
#pragma once

#include <vector>

#include "analysis/ordering/subgraphs.hpp"

namespace espalier::analysis {

struct MinimumDegreeOrder {
  std::vector<Index> order;  ///< vertices, first to last; empty: given up, since the graph fills up too much
  double flops = 0;          ///< of a Cholesky factorization in this order: multiply and add count as two
  Index largest = 0;         ///< weight of the largest front: a pivot and what it is joined to
};

/// Minimum degree on a quotient graph, with bounds of the external degrees instead of the degrees themselves, mass
/// elimination, indistinguishable vertices and absorbed elements (Amestoy, Davis, Duff 1996), weighted. Sequential, and
/// nevertheless a tenth of what dissection takes. Ties go to the vertex whose degree changed last.
MinimumDegreeOrder approximate_minimum_degree(const PartGraph& graph);
/// The order of the first `inner` vertices; the others, a halo, are eliminated later and count in the degrees only.
/// Edges within the halo need not be there.
MinimumDegreeOrder approximate_minimum_degree(const PartGraph& graph, Index inner);

}  // namespace espalier::analysis

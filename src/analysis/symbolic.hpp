/// \file
/// Symbolic factorization: from an elimination order to the assembly tree.
#pragma once

#include <vector>

#include "analysis/ordering.hpp"
#include "analysis/ordering/graph.hpp"

namespace espalier::analysis {

/// The assembly tree of an elimination order of the vertices of `graph`, up to reorderings that keep the fill
/// (postorder, order of children) and amalgamation. Fills nonzeros_factor, flops and flops_exact of `statistics`.
AssemblyTree symbolic_tree(const CompressedGraph& graph, std::vector<Index> order, base::ThreadPool& pool,
                           TreeStatistics& statistics);

}  // namespace espalier::analysis

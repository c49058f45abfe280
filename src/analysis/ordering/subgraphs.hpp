/// \file
/// Parts of weighted graphs: induced subgraphs and connected components.
#pragma once

#include <span>
#include <vector>

#include "analysis/ordering/coarsen.hpp"

namespace espalier::analysis {

/// The graph of the vertices `members`, in that order; all edges weigh 1.
/// @param ptr, adj, weight the whole graph
/// @param place where each vertex of the whole graph stands in `members`; -1: nowhere
PartGraph induced(std::span<const Offset> ptr, std::span<const Index> adj, std::span<const Index> weight,
                  std::span<const Index> members, std::span<const Index> place, base::Recursion& workers);

/// The vertices v with pick[v] == which, ascending, and their places in that list, written to place[v].
std::vector<Index> members_of(std::span<const char> pick, char which, std::span<Index> place, base::Recursion& workers);

/// Connected components, numbered from 0 in the order of their lowest vertices. @return their number
Index components(const PartGraph& graph, std::vector<Index>& component, base::Recursion& workers);

}  // namespace espalier::analysis

/// \file
/// Nested dissection.
#pragma once

#include <vector>

#include "analysis/graph.hpp"

namespace espalier::analysis {

/// Fill-reducing elimination orders of the vertices of a graph: order[k] goes k-th. The same for every pool.
struct Orders {
  std::vector<Index> dissection;
  std::vector<Index> minimum_degree;  ///< empty: not tried, or given up
  double minimum_degree_flops = 0;    ///< of L L^T, without dense vertices
};

/// @param minimum_degree  makes that order, too, beside the other
Orders fill_reducing_orders(const CompressedGraph& graph, bool minimum_degree, base::ThreadPool& pool);

/// Dissection alone.
std::vector<Index> nested_dissection(const CompressedGraph& graph, base::ThreadPool& pool);

}  // namespace espalier::analysis

/// \file
/// Nested dissection.
#pragma once

#include <vector>

#include "analysis/ordering/approximate_degree.hpp"
#include "analysis/ordering/graph.hpp"

namespace espalier::analysis {

/// Fill-reducing elimination orders of the vertices of a graph: order[k] goes k-th. The same for every pool.
struct Orders {
  std::vector<Index> dissection;      ///< empty: minimum degree will do
  std::vector<Index> minimum_degree;  ///< empty: not tried, or given up
  double minimum_degree_flops = 0;    ///< of L L^T, without dense vertices
};

/// Whether dissection would hardly pay: minimum degree, which takes a tenth of its time, has found a factor of little
/// work, and fronts as they are in a plane. Those of a body in space are larger, and there dissection needs half of the
/// flops. Chains are not told: theirs is a question of the tree.
/// @param vertices, weight  of the graph
bool minimum_degree_will_do(const MinimumDegreeOrder& order, Index vertices, Offset weight);

/// @param minimum_degree  makes that order, too; of a graph that is not large, first
Orders fill_reducing_orders(const CompressedGraph& graph, bool minimum_degree, base::ThreadPool& pool);

/// Dissection alone.
std::vector<Index> nested_dissection(const CompressedGraph& graph, base::ThreadPool& pool);

}  // namespace espalier::analysis

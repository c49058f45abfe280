/// \file
/// Elimination trees and column counts of weighted graphs. Vertices stand in elimination order: vertex k goes k-th.
#pragma once

#include <span>
#include <vector>

#include "analysis/ordering/graph.hpp"

namespace espalier::analysis {

/// The graph with vertex order[k] renamed to k. Neighbours of a vertex are not sorted.
Graph permute(const Graph& graph, std::span<const Index> order, base::ThreadPool& pool);

/// position[order[k]] = k
std::vector<Index> inverse(std::span<const Index> order, base::ThreadPool& pool);

/// parent[k]: the first vertex after k in the column k of L, -1 for a root (Liu 1986, with path compression; ranges of
/// positions without edges to lower ones are taken side by side). The vertices are those of `graph` in the order
/// `order`: parent is indexed by position.
std::vector<Index> elimination_tree(const Graph& graph, std::span<const Index> order, base::ThreadPool& pool);

/// Children before parents, every sub-tree contiguous, roots and children in rising order.
std::vector<Index> postorder(std::span<const Index> parent);

/// For each vertex of a graph in postorder the total weight of the rows of its column of L, itself included
/// (Gilbert, Ng, Peyton 1994; row sub-trees counted by weight; small sub-trees are taken side by side).
std::vector<Index> column_weights(const Graph& postordered, std::span<const Index> parent,
                                  std::span<const Index> weight, base::ThreadPool& pool);

}  // namespace espalier::analysis

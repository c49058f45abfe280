/// \file
/// From a symmetric pattern to an assembly tree: compression, nested dissection, minimum degree, elimination tree,
/// supernodes, amalgamation.
#pragma once

#include <span>
#include <vector>

#include "analysis/assembly_tree.hpp"
#include "analysis/ordering/graph.hpp"
#include "base/thread_pool.hpp"
#include "espalier/types.hpp"

namespace espalier::analysis {

/// What the caller of build_tree may choose.
struct TreeOptions {
  std::span<const Index> permutation;  ///< the caller's elimination order; empty: nested dissection
  /// n entries or empty: pair[v] == w and pair[w] == v when v and w should be eliminated next to each other in one
  /// front (a 2x2 pivot candidate), pair[v] == v otherwise
  std::span<const Index> pair;
  /// n entries or empty: true for an unknown that must not be eliminated before at least one (matching: its pair;
  /// without: all) of its neighbours has been eliminated or is in the same front: a multiplier with a zero diagonal
  std::span<const char> zero_diagonal;
};

/// Figures of the ordering itself.
struct TreeStatistics {
  double ordering_seconds = 0;
  double symbolic_seconds = 0;
  Offset nonzeros_factor = 0;  ///< entries of L with amalgamation, diagonal included
  double flops = 0;            ///< of L L^T with amalgamation: sum over columns of (entries of the column)^2
  double flops_exact = 0;      ///< likewise without amalgamation
};

/// @throws Error(invalid_input) for a permutation that is not one
AssemblyTree build_tree(const Graph& graph, const TreeOptions& options, base::ThreadPool& pool,
                        TreeStatistics* statistics = nullptr);

}  // namespace espalier::analysis

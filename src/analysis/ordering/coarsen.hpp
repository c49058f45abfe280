/// \file
/// Coarsening of weighted graphs by heavy-edge matching, for multilevel separators.
#pragma once

#include <cstdint>
#include <vector>

#include "base/lazy_vector.hpp"
#include "base/mix.hpp"
#include "base/thread_pool.hpp"
#include "espalier/types.hpp"

namespace espalier::analysis {

/// A small generator of our own, so that separators do not depend on the library or the thread (splitmix64; Steele,
/// Lea, Flood 2014).
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}
  std::uint64_t next() { return base::mix(state_ += 0x9e3779b97f4a7c15ULL); }
  /// 0 .. below - 1, below > 0
  Index below(Index below) { return static_cast<Index>((next() >> 32) * static_cast<std::uint64_t>(below) >> 32); }

 private:
  std::uint64_t state_;
};

/// A graph with vertex and edge weights; adjacency lists without the vertex itself, not sorted.
struct PartGraph {
  std::vector<Offset> ptr;       ///< n + 1
  base::LazyVector<Index> adj;   ///< ptr[n]
  base::LazyVector<Index> edge;  ///< ptr[n]; number of edges of the finest graph that this edge stands for
  std::vector<Index> weight;     ///< n; number of unknowns in each vertex
  Offset total = 0;              ///< sum of weight

  [[nodiscard]] Index n() const { return static_cast<Index>(weight.size()); }
};

/// A coarser graph and where each vertex of the finer one went.
struct Coarser {
  PartGraph graph;
  std::vector<Index> map;  ///< vertices of the finer graph -> vertices of the coarser
};

/// Contracts a matching that prefers heavy edges (Karypis and Kumar 1998, sorted heavy-edge matching): vertices of low
/// degree choose first. The same for any number of workers.
/// @param most_weight no coarse vertex of two vertices becomes heavier than that
/// @param workers idle ones help with large graphs
Coarser coarsen(const PartGraph& graph, Offset most_weight, Random& random, base::Recursion& workers);

}  // namespace espalier::analysis

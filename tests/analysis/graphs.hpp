/// \file
/// Small graphs and matrices for the tests of the analysis.
#pragma once

#include <algorithm>
#include <random>
#include <utility>
#include <vector>

#include "analysis/ordering/graph.hpp"

namespace espalier::analysis::testing {

using Edges = std::vector<std::pair<Index, Index>>;

inline Graph graph_of_edges(Index n, const Edges& edges) {
  std::vector<std::vector<Index>> lists(static_cast<std::size_t>(n));
  for (const auto& [u, v] : edges) {
    if (u == v) continue;
    lists[static_cast<std::size_t>(u)].push_back(v);
    lists[static_cast<std::size_t>(v)].push_back(u);
  }
  Graph g{n, {0}, {}};
  for (auto& list : lists) {
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
    g.adj.append(list.begin(), list.end());
    g.ptr.push_back(static_cast<Offset>(g.adj.size()));
  }
  return g;
}

inline Graph chain(Index n) {
  Edges e;
  for (Index k = 1; k < n; ++k) e.emplace_back(k - 1, k);
  return graph_of_edges(n, e);
}

inline Graph star(Index n) {  // vertex 0 in the middle
  Edges e;
  for (Index k = 1; k < n; ++k) e.emplace_back(0, k);
  return graph_of_edges(n, e);
}

inline Graph complete(Index n) {
  Edges e;
  for (Index i = 0; i < n; ++i)
    for (Index j = 0; j < i; ++j) e.emplace_back(i, j);
  return graph_of_edges(n, e);
}

/// nx x ny x nz points, each joined to those that differ by at most 1 in every coordinate (the nodes of hex8
/// elements), `dofs` unknowns per point.
inline Graph brick(Index nx, Index ny, Index nz, Index dofs) {
  const Index points = nx * ny * nz;
  Graph g{points * dofs, {0}, {}};
  for (Index p = 0; p < points; ++p) {
    const Index x = p % nx, y = p / nx % ny, z = p / nx / ny;
    for (Index d = 0; d < dofs; ++d) {
      for (Index c = std::max(0, z - 1); c <= std::min(nz - 1, z + 1); ++c)
        for (Index b = std::max(0, y - 1); b <= std::min(ny - 1, y + 1); ++b)
          for (Index a = std::max(0, x - 1); a <= std::min(nx - 1, x + 1); ++a)
            for (Index e = 0; e < dofs; ++e)
              if (const Index u = ((c * ny + b) * nx + a) * dofs + e; u != p * dofs + d) g.adj.push_back(u);
      g.ptr.push_back(static_cast<Offset>(g.adj.size()));
    }
  }
  return g;
}

/// nx x ny x nz points, each joined to its neighbours along the axes (finite differences: 5 or 7 points).
inline Graph axis_grid(Index nx, Index ny, Index nz) {
  Edges e;
  for (Index p = 0; p < nx * ny * nz; ++p) {
    if (p % nx + 1 < nx) e.emplace_back(p, p + 1);
    if (p / nx % ny + 1 < ny) e.emplace_back(p, p + nx);
    if (p / nx / ny + 1 < nz) e.emplace_back(p, p + nx * ny);
  }
  return graph_of_edges(nx * ny * nz, e);
}

inline Edges random_edges(Index n, Index count, std::mt19937& random) {
  std::uniform_int_distribution<Index> pick(0, n - 1);
  Edges e;
  for (Index k = 0; k < count; ++k) e.emplace_back(pick(random), pick(random));
  return e;
}

}  // namespace espalier::analysis::testing

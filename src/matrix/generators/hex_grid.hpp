/// \file
/// A structured grid of nx x ny x nz brick elements and its nodes.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "base/at.hpp"
#include "matrix/generators/group_model.hpp"
#include "matrix/generators/random.hpp"

namespace espalier::matrix {

/// A place in the grid: of a node (0..nx, 0..ny, 0..nz) or of an element (0..nx-1, ...).
struct GridPlace {
  Index x = 0, y = 0, z = 0;
};

/// Counts and numbers; z runs fastest.
struct HexGrid {
  Index nx = 0, ny = 0, nz = 0;  ///< elements in each direction, at least 1

  [[nodiscard]] std::int64_t nodes() const {
    return (nx + std::int64_t{1}) * (ny + std::int64_t{1}) * (nz + std::int64_t{1});
  }
  [[nodiscard]] std::int64_t elements() const { return std::int64_t{nx} * ny * nz; }
  [[nodiscard]] Index node(GridPlace p) const { return (p.x * (ny + 1) + p.y) * (nz + 1) + p.z; }
  [[nodiscard]] Index element(GridPlace p) const { return (p.x * ny + p.y) * nz + p.z; }
  [[nodiscard]] GridPlace node_place(Index node) const {
    const Index column = node / (nz + 1);
    return {column / (ny + 1), column % (ny + 1), node % (nz + 1)};
  }

  /// body(place) for the up to 27 nodes that share an element with the node at `p`, itself included, in rising order.
  template <class Body>
  void for_each_neighbour(GridPlace p, const Body& body) const {
    for (Index x = std::max<Index>(p.x - 1, 0); x <= std::min<Index>(p.x + 1, nx); ++x)
      for (Index y = std::max<Index>(p.y - 1, 0); y <= std::min<Index>(p.y + 1, ny); ++y)
        for (Index z = std::max<Index>(p.z - 1, 0); z <= std::min<Index>(p.z + 1, nz); ++z) body(GridPlace{x, y, z});
  }

  /// body(element, a, b) for the elements that hold both nodes, at their corners a and b (numbered as in hex8.hpp).
  /// @pre the nodes are neighbours
  template <class Body>
  void for_each_shared_element(GridPlace p, GridPlace q, const Body& body) const {
    const auto range = [](Index u, Index v, Index n) {
      return std::pair{std::max<Index>(std::max(u, v) - 1, 0), std::min<Index>(std::min(u, v), n - 1)};
    };
    const auto [x0, x1] = range(p.x, q.x, nx);
    const auto [y0, y1] = range(p.y, q.y, ny);
    const auto [z0, z1] = range(p.z, q.z, nz);
    for (Index x = x0; x <= x1; ++x)
      for (Index y = y0; y <= y1; ++y)
        for (Index z = z0; z <= z1; ++z) body(GridPlace{x, y, z}, corner(p, x, y, z), corner(q, x, y, z));
  }

 private:
  static std::size_t corner(GridPlace p, Index x, Index y, Index z) {
    const Index number = (p.x - x) + 2 * (p.y - y) + 4 * (p.z - z);
    return at(number);
  }
};

/// One factor in [0.7, 1.3) per element: the spread of its stiffness.
inline std::vector<double> element_factors(std::int64_t elements, std::uint64_t seed) {
  std::vector<double> factors(at(elements));
  for (std::size_t e = 0; e < factors.size(); ++e) factors[e] = 0.7 + 0.6 * random_unit(seed, e);
  return factors;
}

}  // namespace espalier::matrix

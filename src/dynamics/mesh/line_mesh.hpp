/// \file
/// Line elements of a mesh as chains, which our beams and cables are made of.
#pragma once

#include <array>
#include <vector>

#include "dynamics/mesh/mesh.hpp"

namespace espalier::dynamics {

/// Elements one after the other, of one section: between nodes first .. first + lengths.size() of the body.
struct LineChain {
  Index first = 0;
  std::vector<double> lengths;
  std::size_t section = 0;
};

struct LineMesh {
  Mesh mesh;  ///< line2, chain by chain; a node of the file where chains meet is there once for each, sets have the
              ///< first
  std::vector<std::array<Point, 3>> axes;  ///< of the section at each node: x along the line, y, z
  std::vector<LineChain> chains;
  std::vector<std::array<Index, 2>> joined;  ///< nodes that are one in the file: the first of them, and another
};

/// What is known of each element of a mesh.
struct LineElements {
  std::vector<std::size_t> section;
  std::vector<Point> y;  ///< towards the section's y axis
  bool pinned = false;   ///< each element turns as it likes at its nodes: no chain has two
};

/// An element of three nodes becomes two, straight ones. A chain goes on over a node where two elements alone meet,
/// head to tail, along one line and with the same section and axes.
/// @param mesh  line elements alone, no unused nodes @throws Error(invalid_input) that names elements without length,
/// or whose y axis lies along them
[[nodiscard]] LineMesh make_line_mesh(const Mesh& mesh, const LineElements& elements);

}  // namespace espalier::dynamics

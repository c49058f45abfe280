/// \file
/// The drawn surface of one flexible body: which points it has, and where they are in a state.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "dynamics/model/mechanism.hpp"

namespace espalier::dynamics::page {

class Skin {
 public:
  virtual ~Skin() = default;
  std::vector<std::array<Index, 3>> triangles;  ///< of its points, anticlockwise seen from outside
  /// The owner of each triangle where elements can fail: whose it is, and what is behind it (-1: nothing), by the mesh.
  /// Else empty.
  std::vector<std::array<Index, 2>> owners;
  std::vector<std::array<Index, 2>> edges;  ///< of elements, and lines that have no surface
  std::vector<std::int64_t> labels;         ///< of each point the number of its node; 0: between nodes
  bool coarse = false;                      ///< mid-side nodes were left out
  [[nodiscard]] Index points() const { return static_cast<Index>(labels.size()); }
  /// Positions from those of all vertices of the body, or velocities from velocities. @param x  3 numbers per point
  virtual void place(const double* vertices, double* x) const = 0;
  /// The velocities in the same way. @param vertices  positions
  virtual void rates(const double* vertices, const double* velocities, double* v) const {
    static_cast<void>(vertices);
    place(velocities, v);
  }
  /// The nodes of solids: the node of each point; empty otherwise.
  [[nodiscard]] virtual const std::vector<Index>& nodes() const;
};

/// @pre the body is flexible
[[nodiscard]] std::unique_ptr<Skin> make_skin(const model::BuiltBody& body);

}  // namespace espalier::dynamics::page

/// \file
/// Flexible bodies divided among GPUs.
#pragma once

#include <span>
#include <vector>

#include "dynamics/device/device_body.hpp"

namespace espalier::dynamics {

/// What one GPU has of a body: some of the vertices, its own, all elements around them, and the other vertices of
/// these. It makes the whole sums of forces and of columns of the tangent of its own vertices, in the order of the
/// undivided body, and so with the same bits; elements between parts are evaluated by each of them.
struct BodySubdomain {
  Index place;                  ///< of its GPU
  std::vector<Index> vertices;  ///< of the body, ascending; what follows counts vertices by their place in this list
  std::vector<Index> own;       ///< ascending
  std::vector<Index> elements;  ///< of the body, counted over all groups, ascending
  std::vector<Offset> entries;  ///< of the body's pattern, for each entry of this one's
  std::vector<DeviceElements> groups;
  std::vector<double> reference, mass, weight;
  VertexPattern pattern;  ///< columns of own vertices; the others are empty
  double mass_damping, stiffness_damping;

  /// Lent by the part, which may be moved.
  [[nodiscard]] DeviceBodyTables tables() const;
};

/// @param place_of_vertex  the place of the GPU whose own it is, from 0
/// @return parts that own a vertex at least, by place
[[nodiscard]] std::vector<BodySubdomain> divide_body(const DeviceBodyTables& body,
                                                     std::span<const Index> place_of_vertex);

}  // namespace espalier::dynamics

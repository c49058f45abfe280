/// \file
/// The element shapes that meshes hold, with their node order and faces.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "espalier/types.hpp"

namespace espalier::dynamics {

/// The shape of an element. Node order: that of Abaqus, which is also that of VTK for every shape listed
/// (corners first; mid-side nodes of tet10: edges 01 12 20 03 13 23; of hex20: 01 12 23 30, 45 56 67 74, 04 15 26 37;
/// of wedge15: 01 12 20, 34 45 53, 03 14 25).
enum class ElementType : std::uint8_t {
  point1,
  line2,
  line3,
  tri3,
  tri6,
  quad4,
  quad8,
  tet4,
  tet10,
  hex8,
  hex20,
  wedge6,
  wedge15,
  pyramid5,
};
inline constexpr int kElementTypes = 14;
inline constexpr int kMaxElementNodes = 20;

/// Nodes of one face of a solid: positions within the element's node list, counted anticlockwise seen from outside.
struct FaceShape {
  ElementType type;
  std::span<const int> nodes;
};

/// What is fixed for one element shape.
struct ElementShape {
  ElementType type;
  std::string_view name;             ///< "tet10"
  int nodes;                         ///< number of nodes
  int corners;                       ///< the first `corners` nodes are corners
  int dimension;                     ///< 0 point, 1 line, 2 surface, 3 solid
  int vtk_type;                      ///< VTK cell type number (vtkCellType.h)
  std::span<const FaceShape> faces;  ///< of solids, in the order of Abaqus (S1, S2, ...); empty otherwise
};

/// The constants of a shape. Never fails for a value of the enumeration.
const ElementShape& shape_of(ElementType type);

/// True for the solids that FlexibleBody can simulate: all but pyramids.
constexpr bool is_simulated_solid(ElementType t) { return t >= ElementType::tet4 && t <= ElementType::wedge15; }

}  // namespace espalier::dynamics

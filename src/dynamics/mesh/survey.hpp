/// \file
/// What a mesh holds, for people: sizes, volume, quality, defects.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "dynamics/mesh/mesh.hpp"

namespace espalier::dynamics {

struct MeshSurvey {
  std::map<std::string, Index> elements;  ///< how many of each shape
  Index nodes = 0, solids = 0, simulated = 0, unused_nodes = 0, outer_faces = 0;
  Point least{}, most{};                       ///< of the nodes that elements use
  double volume = 0;                           ///< of solids, with curved faces as they are
  Point centre{};                              ///< of that volume
  double surface = 0;                          ///< of the outer faces of solids and of surface elements
  double shortest_edge = 0, longest_edge = 0;  ///< between corners
  /// The shape of solids, over the longest three edges of a corner: the volume that they span, over the product of
  /// their lengths; 1 in a cube, 0.71 in a regular tetrahedron, not positive where the element is inverted there.
  double least_shape = 0, median_shape = 0;
  Index worst_element = -1;          ///< that of least_shape
  std::vector<Index> pieces;         ///< a node of each
  std::vector<std::string> defects;  ///< in words, with numbers of the file
  std::string units;                 ///< "m, kg, s" or "mm, t, s", with what speaks for it
};

/// @param mesh  as its file states it
[[nodiscard]] MeshSurvey survey_mesh(const Mesh& mesh);

/// Volume and first moments of the solids `elements` (empty: all): integrals over their faces, exact for straight and
/// curved ones of first and second order.
struct VolumeIntegrals {
  double volume = 0;
  Point moment{};  ///< integral of x
};
[[nodiscard]] VolumeIntegrals volume_integrals(const Mesh& mesh, std::span<const Index> elements = {});

}  // namespace espalier::dynamics

/// \file
/// Surface elements of a mesh as quadrilaterals with directors, which our shells are made of.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "dynamics/mesh/mesh.hpp"

namespace espalier::dynamics {

/// The nodes lie in the middle of the thickness; those of `mesh` where its file has them.
struct ShellMesh {
  Mesh mesh;                                ///< quad4 alone; the node set "boundary": nodes on free edges
  std::vector<Point> positions, directors;  ///< of each node; |d| = thickness there, across its faces, over `thickness`
  double thickness = 0;                     ///< the mean of the elements'
  std::size_t turned = 0;                   ///< quadrilaterals whose normal was turned to the side of the others
  std::vector<std::string> notices;
};

/// Quadrilaterals of 4 nodes are taken as they are. One of 8 nodes becomes four, a triangle of 6 three, by its nodes in
/// the middles of edges and a new one inside. Where there are triangles of 3 nodes, all elements without nodes in the
/// middles get them: triangles become three quadrilaterals, quadrilaterals four.
///
/// Normals are made to point to one side, that of the first element of each piece. The director of a node is the mean
/// normal of its faces; at a fold it is longer, so that both walls keep their thickness up to the mitre.
///
/// @param mesh  surface elements alone, no unused nodes @param thickness  at the corners of each element, above 0
/// @param offset  from the nodes to the middle, along the normals, over the thickness
/// @throws Error(invalid_input) for other elements, edges of more than two elements, surfaces with one side, folds that
/// are too sharp, elements without area; names elements and nodes
[[nodiscard]] ShellMesh make_shell_mesh(const Mesh& mesh, const std::vector<std::array<double, 4>>& thickness,
                                        double offset);

}  // namespace espalier::dynamics

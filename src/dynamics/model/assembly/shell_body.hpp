/// \file
/// Shell bodies: grids, and surface elements of mesh files.
#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "dynamics/model/build/builders.hpp"

namespace espalier::dynamics::model {

/// Makes the body and fills in what its spec leaves to the mesh: nodes, sets, thickness, offset, material.
/// @param statics  without a density, too
/// @throws Error(invalid_input), std::invalid_argument
[[nodiscard]] std::unique_ptr<FlexibleBody> make_shell(const BodySpec& spec, bool statics, BuiltBody& out);

/// Nodes of a set of a shell: of its file, "boundary"; of a grid x0, x1, y0, y1, all.
/// @throws std::invalid_argument that names the sets
[[nodiscard]] const std::vector<Index>& shell_nodes(const BuiltBody& body, const std::string& name);

/// A side of some or all quadrilaterals, and where it is: from the middle, along the directors.
struct PressedSide {
  std::vector<std::array<Index, 4>> quads;
  double height = 0;
};
/// @param face  "top", "bottom", "middle" (pressed as the top is), or these behind the name of a set of elements or
/// nodes: "SET top"
/// @throws std::invalid_argument that names what there is
[[nodiscard]] PressedSide pressed_side(const ShellSpec& shell, const std::string& face);

/// A node as the mesh has it, which lies beside the middle of the thickness where there is an offset.
[[nodiscard]] HeldPoint shell_node(const BuiltBody& body, Index node);
/// There, with axes that turn as the director does, and about it as the edges that begin there.
[[nodiscard]] std::unique_ptr<FlexibleFrame> shell_node_frame(const BuiltBody& body, Index node, const Mat3& axes);

}  // namespace espalier::dynamics::model

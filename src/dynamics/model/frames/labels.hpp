/// \file
/// Nodes by the numbers that their mesh file gives them.
#pragma once

#include <cstdint>
#include <vector>

#include "dynamics/model/mechanism.hpp"

namespace espalier::dynamics::model {

/// The mesh that has the names of nodes, elements and sets: of solids, shells, lines of files; else null.
[[nodiscard]] const Mesh* named_mesh(const BuiltBody& body);

/// Nodes with these labels, in their order: of meshes and substructures as in the file (meshes of our own: from 1), of
/// cables, beams and shells counted from 1, -1 the last.
/// @throws std::invalid_argument for a label that is not there, with those that are near
[[nodiscard]] std::vector<Index> nodes_labelled(const BuiltBody& body, const std::vector<std::int64_t>& labels);

/// Weights of these nodes, each once, by rising indices. Of a node that is labelled twice they add up.
/// @param weights  one for each label
[[nodiscard]] std::vector<double> weights_labelled(const BuiltBody& body, const std::vector<std::int64_t>& labels,
                                                   const std::vector<double>& weights);

}  // namespace espalier::dynamics::model

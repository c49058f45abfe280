/// \file
/// The kinds of element groups that bodies are made of.
#pragma once

#include <memory>
#include <vector>

#include "base/thread_pool.hpp"
#include "dynamics/elements/ancf_beam.hpp"
#include "dynamics/elements/ancf_cable.hpp"
#include "dynamics/elements/element.hpp"
#include "dynamics/elements/hex8_strain.hpp"
#include "dynamics/elements/material.hpp"
#include "dynamics/elements/solid.hpp"
#include "dynamics/mesh/mesh.hpp"

namespace espalier::dynamics {

/// How solids are integrated.
struct SolidOptions {
  Hex8Formulation hex8 = Hex8Formulation::enhanced;  ///< for hex8 elements
  bool reduced_hex20 = false;                        ///< 2 x 2 x 2 instead of 3 x 3 x 3 points for hex20
};

/// One group per shape of the simulated solids among `elements` of the mesh (all elements when the list is empty).
/// Vertex indices are node indices of the mesh.
/// @throws Error(invalid_input) that names the first element that is not a simulated solid, or whose Jacobian
/// determinant is not positive at all points where stresses are integrated; std::invalid_argument on a bad
/// material
/// @param pool  threads, here and below; null: the calling one
std::vector<std::unique_ptr<ElementGroup>> make_solid_groups(const Mesh& mesh, std::span<const Index> elements,
                                                             const Material& material, const SolidOptions& options = {},
                                                             base::ThreadPool* pool = nullptr);

/// A notice that counts the elements (as above) folded at a corner, which integration does not see; empty: there are
/// none. @pre make_solid_groups() accepts them
std::string corner_folds(const Mesh& mesh, std::span<const Index> elements, base::ThreadPool* pool = nullptr);

/// The smallest Jacobians of the elements (as above), in their order.
std::vector<SmallestJacobian> smallest_jacobians(const Mesh& mesh, std::span<const Index> elements,
                                                 base::ThreadPool* pool = nullptr);

/// A chain of cables: element e joins nodes nodes[e] and nodes[e + 1]; node k has the vertices 2k (r), 2k + 1 (r_x).
/// @param length undeformed length of every element @param labels  of the elements; empty: from 1 on
std::unique_ptr<ElementGroup> make_cable_group(const CableSection& section, const std::vector<Index>& nodes,
                                               std::vector<double> length, std::vector<std::int64_t> labels = {});

/// A chain of beams: element e joins nodes[e] and nodes[e + 1]; node k has the vertices 4k (r), 4k + 1 (r_x),
/// 4k + 2 (r_y), 4k + 3 (r_z).
std::unique_ptr<ElementGroup> make_beam_group(const BeamSection& section, const std::vector<Index>& nodes,
                                              std::vector<double> length, std::vector<std::int64_t> labels = {});

/// Shells: four nodes each (anticlockwise seen from the side that the directors point to); node k has the vertices
/// 2k (r), 2k + 1 (director).
std::unique_ptr<ElementGroup> make_shell_group(const Material& material, double thickness,
                                               const std::vector<std::array<Index, 4>>& quads);

}  // namespace espalier::dynamics

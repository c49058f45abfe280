/// \file
/// Solids of several materials in one body.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "base/thread_pool.hpp"
#include "dynamics/elements/element.hpp"
#include "dynamics/elements/groups.hpp"
#include "dynamics/elements/material.hpp"
#include "dynamics/mesh/mesh.hpp"

namespace espalier::dynamics {

/// The materials of a mesh's elements.
struct ElementMaterials {
  std::vector<Material> list;
  std::vector<Index> of{};  ///< of each element of the mesh, a place in the list; empty: the first one for all
  [[nodiscard]] const Material& at(Index element) const {
    return list[of.empty() ? 0 : static_cast<std::size_t>(of[static_cast<std::size_t>(element)])];
  }
};

/// As make_solid_groups() of one material, a group for each material and shape: in the order of the list, then of
/// shapes.
std::vector<std::unique_ptr<ElementGroup>> make_solid_groups(const Mesh& mesh, std::span<const Index> elements,
                                                             const ElementMaterials& materials,
                                                             const SolidOptions& options = {},
                                                             base::ThreadPool* pool = nullptr);
/// That of a group of solids; null: of other groups.
[[nodiscard]] const Material* material_of(const ElementGroup& group);

}  // namespace espalier::dynamics

/// \file
/// Which material each element of a solid body is of.
#pragma once

#include <span>

#include "dynamics/elements/solid_parts.hpp"
#include "dynamics/model/mechanism.hpp"

namespace espalier::dynamics::model {

/// That of the text for all, else what the mesh file states for the elements by its sections.
/// @param elements  of the body; empty: all of the mesh
/// @param statics  without a density, too; `massless` says whether one is missing (it is then 1)
/// @throws Error(invalid_input) that says what is missing, or names an element of two materials
[[nodiscard]] ElementMaterials solid_materials(const Mesh& mesh, const SolidSpec& solid,
                                               std::span<const Index> elements, bool statics, bool& massless);

/// The materials of a solid that is built.
[[nodiscard]] ElementMaterials materials_of(const BuiltBody& body);

}  // namespace espalier::dynamics::model

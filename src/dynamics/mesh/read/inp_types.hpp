/// \file
/// What the element types and keywords of Abaqus and CalculiX are to the reader.
#pragma once

#include <optional>
#include <string>

#include "dynamics/mesh/element_type.hpp"

namespace espalier::dynamics {

/// The shape that an element type is read as; none: its elements are passed over. @param name  upper case
[[nodiscard]] std::optional<ElementType> inp_shape(const std::string& name);

/// A continuum element whose shape is unknown: without it a part of the solid would be missing.
[[nodiscard]] bool is_unknown_inp_solid(const std::string& name);

/// A continuum shell, which is read as a solid of its shape.
[[nodiscard]] bool is_inp_solid_shell(const std::string& name);

/// A keyword whose absence changes nothing of the mesh or of what is to be simulated. @param name  upper case, no
/// blanks
[[nodiscard]] bool is_idle_inp_keyword(const std::string& name);

}  // namespace espalier::dynamics

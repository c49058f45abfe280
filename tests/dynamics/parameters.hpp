/// \file
/// Enumerations of tests in words, where gtest would print bytes.
#pragma once

#include <ostream>

#include "dynamics/elements/material.hpp"
#include "dynamics/mesh/element_type.hpp"
#include "espalier/sensitivities.hpp"

namespace espalier {

inline void PrintTo(SensitivityMethod method, std::ostream* out) {
  *out << (method == SensitivityMethod::adjoint ? "adjoint" : "forward");
}

namespace dynamics {

inline void PrintTo(ElementType type, std::ostream* out) { *out << shape_of(type).name; }
inline void PrintTo(SolidLaw law, std::ostream* out) { *out << name_of(kSolidLaws, law); }
}  // namespace dynamics
}  // namespace espalier

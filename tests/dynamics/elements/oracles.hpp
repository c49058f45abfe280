// Elements one at a time, in formulas of their own: what the kernels of dynamics/elements/lanes are compared with.
#pragma once

#include "dynamics/elements/ancf_cable.hpp"
#include "dynamics/elements/ancf_shell.hpp"
#include "dynamics/elements/hex8_strain.hpp"
#include "dynamics/elements/solid.hpp"

namespace espalier::dynamics::oracle {

/// As the functions of these names in espalier::dynamics.
[[nodiscard]] bool evaluate_solid(ElementType type, Rule rule, const Material& material, const ElementInput& in,
                                  ElementOutput& out);
[[nodiscard]] bool evaluate_hex8(Hex8Formulation formulation, const Material& material, const ElementInput& in,
                                 ElementOutput& out);
[[nodiscard]] bool sample_hex8(Hex8Formulation formulation, const Material& material, const double* reference,
                               const double* position, ElementSamples& out);
[[nodiscard]] bool evaluate_cable(const CableSection& section, double length, const ElementInput& in,
                                  ElementOutput& out);
[[nodiscard]] bool evaluate_shell(const Material& material, double thickness, const ElementInput& in,
                                  ElementOutput& out);

}  // namespace espalier::dynamics::oracle

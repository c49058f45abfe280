/// \file
/// Displacement-based solids (solid.hpp) side by side: several elements in the lanes of one vector. The formulas stand
/// once (solid_block-inl.hpp) for a lane type; evaluate_solid() is that of one lane.
#pragma once

#include "dynamics/elements/element.hpp"
#include "dynamics/elements/material.hpp"
#include "dynamics/elements/shape_functions.hpp"

namespace espalier::dynamics {

/// What the kernels need to know of the law.
struct SolidConstants {
  bool neo_hookean = false;   ///< else St. Venant-Kirchhoff
  double lambda = 0, mu = 0;  ///< Lame's constants
};

/// Evaluates as many elements as the kernels have lanes. @return bit l is set where the element of lane l is whole; the
/// others' output is undefined
template <int kNodes, int kPoints>
using SolidKernel = unsigned (*)(const SolidConstants& law, const ShapeTable<kNodes, kPoints>& table,
                                 const BlockInput& in, const BlockOutput& out);

/// Kernels and their number of lanes.
struct SolidKernels {
  int width = 1;
#define ESPALIER_KERNEL(kind, nodes, points) SolidKernel<nodes, points> kind = nullptr;
  ESPALIER_FOR_SOLIDS(ESPALIER_KERNEL)
#undef ESPALIER_KERNEL
};
/// One element at a time.
[[nodiscard]] SolidKernels scalar_solid_kernels();
/// As many lanes as the vectors of this processor have.
[[nodiscard]] SolidKernels vector_solid_kernels();

/// Evaluates kernels.width elements of `type`; otherwise as evaluate_solid().
[[nodiscard]] unsigned evaluate_solid_block(const SolidKernels& kernels, ElementType type, Rule rule,
                                            const Material& material, const BlockInput& in, const BlockOutput& out);

}  // namespace espalier::dynamics

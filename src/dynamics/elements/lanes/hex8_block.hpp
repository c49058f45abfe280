/// \file
/// Eight-node hexahedra of hex8_strain.hpp side by side, several elements in the lanes of one vector. The formulas
/// stand once for a lane type: hex8_block-inl.hpp for St. Venant-Kirchhoff solids, hex8_strain_block-inl.hpp for shells
/// and for neo-Hookean ones. evaluate_hex8() is that of one lane.
#pragma once

#include "dynamics/elements/hex8_strain.hpp"
#include "dynamics/elements/hex8_tables.hpp"
#include "dynamics/elements/lanes/lane_kernel.hpp"

namespace espalier::dynamics {

/// What a kernel needs to know of the formulation and the law.
struct Hex8Law {
  Hex8Formulation formulation = Hex8Formulation::full;
  double lambda = 0, mu = 0;  ///< Lame's constants
  bool neo_hookean = false;   ///< else St. Venant-Kirchhoff
  /// Its formulas are those of hex8_strain_block-inl.hpp.
  [[nodiscard]] bool by_strains() const { return neo_hookean || formulation == Hex8Formulation::shell; }
};

[[nodiscard]] inline Hex8Law law_of(Hex8Formulation formulation, const Material& material) {
  return {formulation, material.lambda(), material.mu(), material.law == SolidLaw::neo_hookean};
}

using Hex8Kernel = LaneKernel<Hex8Law>;

/// The numbers that the kernels read.
extern const hex8::BlockTables kHex8BlockTables;
/// One element at a time.
[[nodiscard]] Hex8Kernel scalar_hex8_kernel();
/// As many lanes as the vectors of this processor have.
[[nodiscard]] Hex8Kernel vector_hex8_kernel();

}  // namespace espalier::dynamics

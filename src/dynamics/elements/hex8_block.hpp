/// \file
/// Eight-node hexahedra side by side: the St. Venant-Kirchhoff solids of hex8_strain.hpp (all but shells), several
/// elements in the lanes of one vector. The formulas stand once (hex8_block-inl.hpp) for a lane type; evaluate_hex8()
/// is the second implementation that tests compare with.
#pragma once

#include "dynamics/elements/element.hpp"
#include "dynamics/elements/hex8_strain.hpp"

namespace espalier::dynamics {

/// What a kernel needs to know of the formulation and the law.
struct Hex8Law {
  Hex8Formulation formulation = Hex8Formulation::full;
  double lambda = 0, mu = 0;  ///< Lame's constants
};

/// A kernel and its number of lanes.
struct Hex8Kernel {
  int width = 1;
  /// Evaluates `width` elements. @return bit l is set where the element of lane l is whole; the others' output is
  /// undefined
  unsigned (*evaluate)(const Hex8Law& law, const BlockInput& in, const BlockOutput& out) = nullptr;
};

/// Whether these kernels serve: not for shells, not for laws that are not linear in the Green-Lagrange strain.
[[nodiscard]] inline bool hex8_block_serves(Hex8Formulation formulation, SolidLaw law) {
  return formulation != Hex8Formulation::shell && law == SolidLaw::st_venant_kirchhoff;
}
/// One element at a time.
[[nodiscard]] Hex8Kernel scalar_hex8_kernel();
/// As many lanes as the vectors of this processor have.
[[nodiscard]] Hex8Kernel vector_hex8_kernel();

}  // namespace espalier::dynamics

/// \file
/// Shells of ancf_shell.hpp side by side: the hexahedra of hex8_strain_block-inl.hpp, mapped there and back in
/// ancf_shell_block-inl.hpp. evaluate_shell() is that of one lane.
#pragma once

#include "dynamics/elements/lanes/hex8_block.hpp"

namespace espalier::dynamics {

/// What a kernel needs to know of shells.
struct ShellLaw {
  Hex8Law hexahedra;  ///< Hex8Formulation::shell
  double thickness = 0;
};

using ShellKernel = LaneKernel<ShellLaw>;

/// As kHex8BlockTables, the nodes in pairs: bottom and top of node 1 of the shell, of node 2, ...
extern const hex8::BlockTables kShellBlockTables;
/// One element at a time.
[[nodiscard]] ShellKernel scalar_shell_kernel();
/// As many lanes as the vectors of this processor have.
[[nodiscard]] ShellKernel vector_shell_kernel();

}  // namespace espalier::dynamics

/// \file
/// The elements whose formulas GPUs know: those that have kernels for lanes.
#pragma once

#include <variant>

#include "dynamics/elements/lanes/ancf_cable_block.hpp"
#include "dynamics/elements/lanes/ancf_shell_block.hpp"
#include "dynamics/elements/lanes/hex8_block.hpp"
#include "dynamics/elements/lanes/solid_block.hpp"

namespace espalier::dynamics {

/// The elements of solid_block.hpp.
struct SolidElements {
  ElementType type = ElementType::hex8;
  Rule rule = Rule::stiffness;
  SolidConstants law;
};

/// Elements of one type and law.
struct DeviceLaw {
  std::variant<SolidElements, Hex8Law, ShellLaw, CableLaw> of_kind;
};

}  // namespace espalier::dynamics

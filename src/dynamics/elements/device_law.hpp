/// \file
/// The elements whose formulas GPUs know: those of solid_block.hpp, and of hex8_block.hpp but for shells and
/// neo-Hookean material.
#pragma once

#include "dynamics/elements/hex8_block.hpp"
#include "dynamics/elements/solid_block.hpp"

namespace espalier::dynamics {

/// Elements of one type and law.
struct DeviceLaw {
  ElementType type = ElementType::hex8;
  Rule rule = Rule::stiffness;
  bool assumed_strain = false;  ///< by hex8_block.hpp, with `hexahedra`; else by solid_block.hpp, with `solid`
  Hex8Law hexahedra;
  SolidConstants solid;
};

}  // namespace espalier::dynamics

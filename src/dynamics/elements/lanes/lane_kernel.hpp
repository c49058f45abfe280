/// \file
/// Functions that evaluate several elements side by side, and how many: the formulas for a lane type (*_block-inl.hpp),
/// compiled for one of them. One element at a time has the same formulas, for the lane type of one number.
#pragma once

#include "dynamics/elements/element.hpp"

namespace espalier::dynamics {

template <class Law>
struct LaneKernel {
  int width = 1;
  /// Evaluates `width` elements. @return bit l is set where the element of lane l is whole; the others' output is
  /// undefined
  unsigned (*evaluate)(const Law& law, const BlockInput& in, const BlockOutput& out) = nullptr;
};

/// One element by what a kernel of one lane gives, with its whole tangent. @return whether it is whole
/// @param evaluate  (const BlockInput&, const BlockOutput&) -> bits of lanes
template <class Kernel>
[[nodiscard]] bool evaluate_one(int vertices, const ElementInput& in, ElementOutput& out, const Kernel& evaluate) {
  if (evaluate(BlockInput{in.reference, in.position, in.velocity, in.damping, in.position_weight, in.velocity_weight},
               BlockOutput{out.force, out.tangent, &out.energy}) == 0)
    return false;
  const bool symmetric = in.damping == 0 || in.velocity == nullptr;
  for (int n = 3 * vertices, column = 0; column < n && symmetric && out.tangent != nullptr; ++column)
    for (int row = column / 3 * 3 + 3; row < n; ++row) out.tangent[column * n + row] = out.tangent[row * n + column];
  return true;
}

}  // namespace espalier::dynamics

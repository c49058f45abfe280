/// \file
/// Functions that evaluate several elements side by side, and how many: the formulas for a lane type (*_block-inl.hpp),
/// compiled for one of them.
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

}  // namespace espalier::dynamics

/// \file
/// How the CUDA backend lays a front out: an input of the plan, and what follows from it for the kernels.
#pragma once

#include "device/cuda/tables/tables.hpp"
#include "plan/plan.hpp"

namespace espalier::device::cuda {

inline constexpr Index kNarrowTiles = 32;  ///< width of the tile columns of small fronts
inline constexpr Index kWideTiles = 64;    ///< of all others

/// The shape of a front: all that follows from its layout and form alone.
Front shape_of(const plan::FrontLayout& layout, plan::FrontForm form);

/// Elements in whole chunks.
inline Offset rounded(Offset x) { return (x + kChunk - 1) / kChunk * kChunk; }

/// The sizes of the arrays of such fronts (PlanOptions::arrays).
class CudaArrays : public plan::ArrayLayout {
 public:
  [[nodiscard]] Offset factor_elements(const plan::FrontLayout& layout, plan::FrontForm form) const override;
  [[nodiscard]] Offset contribution_elements(const plan::FrontLayout& layout, plan::FrontForm form) const override;
};

}  // namespace espalier::device::cuda

#include "device/cuda/tables/front_shape.hpp"

#include <bit>

namespace espalier::device::cuda {

namespace {

Index pad(Index x) { return (x + kChunk - 1) / kChunk * kChunk; }

Index width_of(plan::FrontForm form) {
  if (form == plan::FrontForm::whole) return kRowBlock;
  return form == plan::FrontForm::narrow ? kNarrowTiles : kWideTiles;
}

}  // namespace

Front shape_of(const plan::FrontLayout& layout, plan::FrontForm form) {
  Front x;
  x.pivots = layout.pivots;
  x.below = layout.below();
  x.whole = form == plan::FrontForm::whole ? 1 : 0;
  x.width = width_of(form);
  x.width_log2 = std::countr_zero(static_cast<std::uint32_t>(x.width));
  x.inverted = x.width;
  x.pivot_pad = pad(x.pivots);
  x.total_pad = x.pivot_pad + pad(x.below);
  x.below_ld = (x.below + 3) / 4 * 4;
  x.pivot_tiles = layout.pivot_tiles;
  x.tiles = layout.tiles;
  x.pivot_blocks = (x.pivot_pad + kRowBlock - 1) / kRowBlock;
  x.blocks = x.pivot_blocks + (pad(x.below) + kRowBlock - 1) / kRowBlock;
  return x;
}

Offset CudaArrays::factor_elements(const plan::FrontLayout& layout, plan::FrontForm form) const {
  return rounded(shape_of(layout, form).factor_size());
}

Offset CudaArrays::contribution_elements(const plan::FrontLayout& layout, plan::FrontForm form) const {
  return rounded(shape_of(layout, form).contribution_size());
}

}  // namespace espalier::device::cuda

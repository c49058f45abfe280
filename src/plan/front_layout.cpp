#include "plan/front_layout.hpp"

#include <algorithm>

namespace espalier::plan {

namespace {

Index round_up(Index x, Index to) { return (x + to - 1) / to * to; }

// Widths by front size, measured on cores with AVX-512 (docs/notebook/cpu.md, "Tile width").
Index widest_tile(Index rows, const TileRule& rule) {
  if (rule.narrow_width > 0 && rows <= rule.narrow_rows) return rule.narrow_width;
  if (rule.max_block_size > 0) return round_up(std::max(rule.max_block_size, rule.panel), rule.panel);
  if (rows <= 1024) return 128;
  if (rows <= 3072) return 144;
  return 192;
}

// Width of `size` columns cut into tiles of at most `widest`, a multiple of the panel when there are several.
Index tile_width(Index size, Index widest, const TileRule& rule) {
  if (size <= widest) return std::max<Index>(size, 1);
  if (!rule.even) return widest;
  const Index tiles = (size + widest - 1) / widest;
  return round_up((size + tiles - 1) / tiles, rule.panel);
}

}  // namespace

FrontLayout cut_front(Index pivots, Index rows, const TileRule& rule) {
  FrontLayout f;
  f.pivots = pivots;
  f.rows = rows;
  f.panel = rule.panel;
  const bool whole = rows <= rule.whole_rows && pivots <= rule.whole_pivots;
  const Index widest = whole ? std::max(rule.whole_rows, rule.whole_pivots) : widest_tile(rows, rule);
  f.pivot_width = tile_width(pivots, widest, rule);
  f.below_width = tile_width(rows - pivots, widest, rule);
  f.pivot_tiles = (pivots + f.pivot_width - 1) / f.pivot_width;
  const Index below = rows - pivots;
  f.tiles = f.pivot_tiles + (below + f.below_width - 1) / f.below_width;
  return f;
}

}  // namespace espalier::plan

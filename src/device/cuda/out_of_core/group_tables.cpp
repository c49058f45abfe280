// Tables of groups of block columns.
#include <algorithm>

#include "device/cuda/kernels/factor/factor_parameters.hpp"
#include "device/cuda/out_of_core/unit_arrays.hpp"

namespace espalier::device::cuda {

// The group as a front of its own: its pivots are the group's, its rows below all that follow. The arrays have the same
// layout as the large front's columns.
Front OutOfCoreTables::group_front(Index f, Index begin, Index end) const {
  Front x = in_arena(device_.fronts[f]);
  const int first = x.column_begin(begin);
  const Index pivot_end = std::min<Index>(end, x.pivot_tiles);
  const int total = x.total_pad - first;
  if (pivot_end == x.pivot_tiles) {
    x.pivots -= first;
    x.pivot_pad -= first;
  } else {
    x.pivots = x.pivot_pad = (pivot_end - begin) * x.width;
    x.below = total - x.pivot_pad;  // the rows that pad the pivots among them
  }
  x.total_pad = total;
  x.tiles = end - begin;
  x.pivot_tiles = pivot_end - begin;
  x.pivot_blocks = (x.pivot_pad + kRowBlock - 1) / kRowBlock;
  x.blocks = x.pivot_blocks + (total - x.pivot_pad + kRowBlock - 1) / kRowBlock;
  x.position = 0;
  x.flag0 = 0;
  x.link_begin = x.link_end = -1;  // in place
  x.wait_begin = x.wait_end = 0;
  return x;
}

// The large front with its arrays placed such that the group's columns fall on theirs, and the group as a front.
void OutOfCoreTables::place_group(const out_of_core::ColumnGroup& g, Front& whole, Front& own) const {
  const auto& l = plan_.layout[g.front];
  const bool pivots = g.begin < l.pivot_tiles;
  const Index below = std::max(g.begin, l.pivot_tiles) - l.pivot_tiles;
  const Offset before = pivots ? whole.column_offset(g.begin) : 0;
  const Offset before_below =
      below < l.tiles_below() ? whole.contribution_offset(below * whole.width, below * whole.width) : 0;
  const auto place = [&](Front& x, Offset skip, Offset skip_below) {
    x.factor = g.factor_at[0] / element_ - skip;
    x.second = g.factor_at[1] / element_ - skip;
    x.contribution = g.contribution_at[0] / element_ - skip_below;
    x.contribution_up = g.contribution_at[1] / element_ - skip_below;
  };
  place(whole, before, before_below);
  whole.tile0 = pivots ? -l.tile_index(g.begin, g.begin) : 0;
  if (!pivots) return;
  own = group_front(g.front, g.begin, g.end);
  place(own, 0, 0);
}

UnitTables OutOfCoreTables::build(const out_of_core::ColumnGroup& g) const {
  UnitTables u;
  const Index f = g.front;
  const Counts c = count(f, g.begin, g.end);
  u.at = places(c);
  u.scratch = scratch_places(c);
  UnitArrays arrays;
  Front whole = in_arena(device_.fronts[f]), own{};
  place_group(g, whole, own);
  u.width = whole.width;
  const auto& l = plan_.layout[f];
  const bool pivots = g.begin < l.pivot_tiles;
  for (Index j = 0; pivots && j < own.tiles; ++j) arrays.add_column(ahead_, own, 0, j);
  own.tasks = static_cast<std::int32_t>(arrays.tasks.size());
  u.end = static_cast<int>(arrays.tasks.size());
  for (Index j = g.begin; j < g.end; ++j) arrays.add_column(in_turn_, whole, 1, j);
  u.group_end = static_cast<int>(arrays.tasks.size());
  arrays.fronts = {own, whole};
  for (int k = whole.link_begin; k < whole.link_end; ++k) {
    const ChildRows& from = device_.links[k];
    Front child = in_arena(device_.fronts[from.child]);
    arrays.add_relative(plan_, from.child, child);
    arrays.add_link(device_, from, static_cast<std::int32_t>(arrays.fronts.size()), whole.tiles);
    arrays.fronts.push_back(child);
  }
  if (pivots)
    arrays.add_entries(plan_, plan_.first_tile[f] + l.tile_index(g.begin, g.begin), c.tiles - 1, g.first_entry,
                       g.first_entry + g.entries);
  arrays.write(u);
  return u;
}

}  // namespace espalier::device::cuda

#include "device/host/out_of_core/group_tasks.hpp"

#include <cstring>

namespace espalier::device::host {

namespace {

using plan::FrontLayout;

// Where a tile is made.
template <class T>
struct TilePlace {
  TilePlace(NumericState<T>& s, Index f, Index i, Index j) : layout(s.plan.layout[f]) {
    rows = layout.width(i);
    cols = layout.width(j);
    ld = padded<T>(rows);
    lu = s.kind == Kind::lu;
    const auto& m = s.plan.memory;
    const bool pivot = j < layout.pivot_tiles;
    const Offset at =
        pivot ? layout.tile_offset(i, j) : layout.contribution_offset(i - layout.pivot_tiles, j - layout.pivot_tiles);
    c = s.places + ((pivot ? m.factor[f] : m.contribution[f]) + at);
    if (lu) c2 = s.places + ((pivot ? m.factor2[f] : m.contribution2[f]) + at);
  }
  const FrontLayout& layout;
  Index rows, cols;
  Offset ld;
  bool lu;
  T* c;
  T* c2 = nullptr;  // the U^T part of a tile below the diagonal (lu)
};

}  // namespace

Offset slab_offset(const FrontLayout& layout, Index begin, Index column, Index row) {
  const Offset rows = layout.padded_begin(layout.tiles) - layout.padded_begin(row);
  Offset sum = 0;
  for (Index k = begin; k < column; ++k) sum += layout.width(k) * rows;
  return sum;
}

template <class T>
void begin_tile(NumericState<T>& s, Index f, Index i, Index j) {
  const TilePlace<T> t(s, f, i, j);
  const auto bytes = static_cast<std::size_t>(t.ld * t.cols) * sizeof(T);
  const bool two = t.lu && i != j;
  std::memset(static_cast<void*>(t.c), 0, bytes);
  if (two) std::memset(static_cast<void*>(t.c2), 0, bytes);
  const Offset me = s.plan.first_tile[f] + t.layout.tile_index(i, j);
  const std::span<const plan::EntryPlace> entries(
      s.plan.entries.data() + s.plan.entry_ptr[me],
      static_cast<std::size_t>(s.plan.entry_ptr[me + 1] - s.plan.entry_ptr[me]));
  add_entries(entries, s.values, t.c, t.ld, t.lu && i == j ? EntryPart::square : EntryPart::lower);
  if (two) add_entries(entries, s.values, t.c2, t.ld, EntryPart::transposed);
}

template <class T>
void add_child_to_tile(NumericState<T>& s, Workspace<T>& w, Index f, Index i, Index j, const ChildColumns<T>& child) {
  const TilePlace<T> t(s, f, i, j);
  const Index rb = t.layout.begin(i), cb = t.layout.begin(j);
  FrontBlock<T> part{t.c, t.ld, rb, rb + t.rows, cb, cb + t.cols};
  add_contribution(s.plan, child.front, child.part[0], part, false, w.runs, child.columns);
  if (!t.lu) return;
  if (i != j) part.data = t.c2;
  add_contribution(s.plan, child.front, child.part[1], part, i == j, w.runs, child.columns);
}

template <class T>
void update_tile(NumericState<T>& s, Index i, Index j, const SlabColumns<T>& slab) {
  const TilePlace<T> t(s, slab.front, i, j);
  const auto tile = [&](int part, Index r, Index k) {
    if (slab.row < 0)
      return slab.part[part] + (t.layout.tile_offset(r, k) - t.layout.tile_offset(slab.begin, slab.begin));
    return slab.part[part] + slab_offset(t.layout, slab.begin, k, slab.row) +
           t.layout.width(k) * (t.layout.padded_begin(r) - t.layout.padded_begin(slab.row));
  };
  for (Index k = slab.begin; k < slab.end; ++k) {
    const Index depth = t.layout.width(k);
    if (t.lu) {
      s.dense.gemm_nt(t.rows, t.cols, depth, tile(0, i, k), tile(1, j, k), t.c, t.ld);
      if (i != j) s.dense.gemm_nt(t.rows, t.cols, depth, tile(1, i, k), tile(0, j, k), t.c2, t.ld);
      continue;
    }
    const T* left = tile(s.kind == Kind::ldlt ? 1 : 0, i, k);
    if (i == j)
      s.dense.syrk_nt(t.rows, t.cols, depth, left, tile(0, j, k), t.c, t.ld);
    else
      s.dense.gemm_nt(t.rows, t.cols, depth, left, tile(0, j, k), t.c, t.ld);
  }
}

#define ESPALIER_INSTANTIATE(T)                                                                                  \
  template void begin_tile(NumericState<T>&, Index, Index, Index);                                               \
  template void add_child_to_tile(NumericState<T>&, Workspace<T>&, Index, Index, Index, const ChildColumns<T>&); \
  template void update_tile(NumericState<T>&, Index, Index, const SlabColumns<T>&);
ESPALIER_FOR_SCALARS(ESPALIER_INSTANTIATE)
#undef ESPALIER_INSTANTIATE

}  // namespace espalier::device::host

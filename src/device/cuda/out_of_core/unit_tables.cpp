#include "device/cuda/out_of_core/unit_tables.hpp"

#include <algorithm>
#include <cstring>

#include "device/cuda/kernels/factor/factor_parameters.hpp"
#include "plan/regions.hpp"

namespace espalier::device::cuda {

namespace {

Offset aligned(Offset bytes) { return (bytes + 255) / 256 * 256; }

}  // namespace

OutOfCoreTables::OutOfCoreTables(const plan::Plan& plan, Kind kind, Offset element_bytes)
    : plan_(plan),
      kind_(kind),
      element_(element_bytes),
      device_(make_device_plan(plan, kind)),
      ahead_(kind, TaskOrder::by_columns(true)),
      in_turn_(kind, TaskOrder::by_columns(false)),
      wide_(plan::wide_fronts(plan)),
      link_of_(static_cast<std::size_t>(plan.fronts()), -1) {
  for (const Front& x : device_.fronts)
    for (int l = x.link_begin; l < x.link_end; ++l)
      link_of_[static_cast<std::size_t>(device_.links[l].child)] = l - x.link_begin;
}

Offset OutOfCoreTables::pivot_tile_count(Index f) const {
  const auto& l = plan_.layout[f];
  return l.pivot_tiles < l.tiles ? l.tile_index(l.pivot_tiles, l.pivot_tiles) : l.tile_count();
}

Offset OutOfCoreTables::share_bytes(Index f) const {
  const Front& x = device_.fronts[f];
  const Offset entries = plan_.entry_ptr[plan_.first_tile[f + 1]] - plan_.entry_ptr[plan_.first_tile[f]];
  const Offset links = x.link_end - x.link_begin;
  return static_cast<Offset>(sizeof(Front)) + x.tasks * static_cast<Offset>(sizeof(FactorTask)) +
         links * (static_cast<Offset>(sizeof(ChildRows)) + 4 * (x.tiles + 1)) + 4 * x.below +
         8 * (pivot_tile_count(f) + 1) + entries * (8 + element_) + x.flags() * (kind_ == Kind::lu ? 8 : 4) +
         x.pivots * (3 * element_ + 2) + 16;
}

OutOfCoreTables::Counts OutOfCoreTables::count(const out_of_core::InCoreStep& step) const {
  Counts c;
  c.fronts = static_cast<Offset>(step.fronts.size() + step.externals.size());
  c.waits = static_cast<Offset>(step.memory.wait_fronts.size());
  c.entries = step.entries;
  for (const Index f : step.fronts) {
    const Front& x = device_.fronts[f];
    c.tasks += x.tasks;
    c.links += x.link_end - x.link_begin;
    c.bounds += static_cast<Offset>(x.link_end - x.link_begin) * (x.tiles + 1);
    c.relative += x.below;
    c.tiles += pivot_tile_count(f) + 1;
    c.flags += x.flags();
    c.pivots += x.pivots;
  }
  for (const Index f : step.externals) {
    c.relative += device_.fronts[f].below;
    c.set_flags += device_.fronts[f].flags();
  }
  return c;
}

OutOfCoreTables::Counts OutOfCoreTables::count(Index f, Index begin, Index end) const {
  const Front& x = device_.fronts[f];
  const auto& l = plan_.layout[f];
  Counts c;
  const Index pivot_end = std::min(end, l.pivot_tiles);
  const Offset blocks = x.blocks;
  // At most: every block of every column, its second part, and the diagonal tiles; twice.
  c.tasks = 2 * (end - begin) * (blocks * (kind_ == Kind::lu ? 2 : 1) + 1) + 2 * (end - begin);
  c.links = x.link_end - x.link_begin;
  c.bounds = c.links * (x.tiles + 1);
  c.fronts = 2 + c.links;
  for (int k = x.link_begin; k < x.link_end; ++k) c.relative += device_.fronts[device_.links[k].child].below;
  if (begin < pivot_end) {
    const Offset* ptr = plan_.entry_ptr.data() + plan_.first_tile[f];
    const Offset first = l.tile_index(begin, begin);
    const Offset last = pivot_end < l.tiles ? l.tile_index(pivot_end, pivot_end) : l.tile_count();
    c.tiles = last - first + 1;
    c.entries = ptr[last] - ptr[first];
    const Front g = group_front(f, begin, end);
    c.flags = g.flags();
    c.pivots = g.pivots;
  }
  return c;
}

TablePlaces OutOfCoreTables::places(const Counts& c) {
  TablePlaces t;
  Offset at = 0;
  const auto reserve = [&](Offset& place, Offset count, std::size_t size) {
    place = at;
    at = aligned(at + count * static_cast<Offset>(size));
  };
  reserve(t.fronts, c.fronts, sizeof(Front));
  reserve(t.tasks, c.tasks, sizeof(FactorTask));
  reserve(t.links, c.links, sizeof(ChildRows));
  reserve(t.bounds, c.bounds, 4);
  reserve(t.waits, c.waits, 4);
  reserve(t.relative, c.relative, 4);
  reserve(t.entry_ptr, c.tiles, 8);
  reserve(t.entries, c.entries, 8);
  t.bytes = at;
  return t;
}

ScratchPlaces OutOfCoreTables::scratch_places(const Counts& c) const {
  ScratchPlaces s;
  constexpr Offset kControlBytes = (kCounters * 4 + 63) / 64 * 64;
  Offset at = 0;
  const auto reserve = [&](Offset& place, Offset bytes) {
    place = at;
    at += bytes;
  };
  const Offset vector = aligned(c.pivots * element_);
  reserve(s.pivot, vector);
  reserve(s.inverse_d, kind_ == Kind::ldlt ? vector : 0);
  reserve(s.inverse_e, kind_ == Kind::ldlt ? vector : 0);
  reserve(s.replaced, aligned(c.pivots));
  reserve(s.failed, aligned(c.pivots));
  reserve(s.control, kControlBytes);
  s.part_flags = c.flags + c.set_flags;
  s.set_flags = c.set_flags;
  reserve(s.flags, s.part_flags * (kind_ == Kind::lu ? 8 : 4));
  reserve(s.finished, c.fronts * 4);
  s.bytes = aligned(at);
  s.pivots = c.pivots;
  return s;
}

TablePlaces OutOfCoreTables::tables(const out_of_core::InCoreStep& step) const { return places(count(step)); }
ScratchPlaces OutOfCoreTables::scratch(const out_of_core::InCoreStep& step) const {
  return scratch_places(count(step));
}
TablePlaces OutOfCoreTables::tables(Index f, Index begin, Index end) const { return places(count(f, begin, end)); }
ScratchPlaces OutOfCoreTables::scratch(Index f, Index begin, Index end) const {
  return scratch_places(count(f, begin, end));
}

}  // namespace espalier::device::cuda

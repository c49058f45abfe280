#include "device/cuda/stream_tables.hpp"

#include <algorithm>
#include <cstring>

#include "device/cuda/factor_parameters.hpp"

namespace espalier::device::cuda {

namespace {

constexpr Offset kAligned = 256;
Offset aligned(Offset bytes) { return (bytes + kAligned - 1) / kAligned * kAligned; }

template <class U>
void put(UnitTables& u, Offset at, const std::vector<U>& list) {
  if (!list.empty()) std::memcpy(u.bytes.data() + at, list.data(), list.size() * sizeof(U));
}

FactorTask task_of(std::int32_t front, Work work, int part, Index block, Index column) {
  FactorTask t;
  t.front = front;
  t.work = work;
  t.part = static_cast<decltype(t.part)>(part);
  t.block = static_cast<decltype(t.block)>(block);
  t.column = static_cast<decltype(t.column)>(column);
  return t;
}

// A front of the whole plan, for tables whose arrays all count from the arena's start.
template <class F>
F in_arena(F x) {
  x.region = 0;
  if constexpr (requires { x.first_place; }) x.first_place = -1;
  return x;
}

analysis::Entry with_source(const analysis::Entry& e, Offset source) {
  return {source, e.row(), e.col(), e.transposed()};
}

}  // namespace

StreamTables::StreamTables(const analysis::Plan& plan, Kind kind, Offset element_bytes)
    : plan_(plan), kind_(kind), element_(element_bytes), device_(make_device_plan(plan, kind)) {
  const auto n = static_cast<std::size_t>(plan.fronts());
  narrow_.assign(n, 1);
  link_of_.assign(n, -1);
  constexpr Index kWide = 64;
  for (Index f = 0; f < plan.fronts(); ++f) {
    if (device_.fronts[f].width == kWide) narrow_[f] = 0;
    const Index p = plan.tree.parent[f];
    if (p >= 0 && narrow_[f] == 0) narrow_[p] = 0;
    for (int l = device_.fronts[f].link_begin; l < device_.fronts[f].link_end; ++l)
      link_of_[static_cast<std::size_t>(device_.links[l].child)] = l - device_.fronts[f].link_begin;
  }
  order_ = plan.tasks;
  std::stable_partition(order_.begin(), order_.end(),
                        [&](const analysis::Task& task) { return narrow_[task.front] != 0; });
}

Offset StreamTables::pivot_tile_count(Index f) const {
  const auto& l = plan_.layout[f];
  return l.pivot_tiles < l.tiles ? l.tile_index(l.pivot_tiles, l.pivot_tiles) : l.tile_count();
}

Offset StreamTables::share_bytes(Index f) const {
  const Front& x = device_.fronts[f];
  const Offset entries = plan_.entry_ptr[plan_.first_tile[f + 1]] - plan_.entry_ptr[plan_.first_tile[f]];
  const Offset links = x.link_end - x.link_begin;
  return static_cast<Offset>(sizeof(Front)) + x.tasks * static_cast<Offset>(sizeof(FactorTask)) +
         links * (static_cast<Offset>(sizeof(Link)) + 4 * (x.tiles + 1)) + 4 * x.below + 8 * (pivot_tile_count(f) + 1) +
         entries * (8 + element_) + x.flags() * (kind_ == Kind::lu ? 8 : 4) + x.pivots * (3 * element_ + 2) + 16;
}

StreamTables::Counts StreamTables::count(const analysis::InCoreStep& step) const {
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

TablePlaces StreamTables::places(const Counts& c) {
  TablePlaces t;
  Offset at = 0;
  const auto put = [&](Offset& place, Offset count, std::size_t size) {
    place = at;
    at = aligned(at + count * static_cast<Offset>(size));
  };
  put(t.fronts, c.fronts, sizeof(Front));
  put(t.tasks, c.tasks, sizeof(FactorTask));
  put(t.links, c.links, sizeof(Link));
  put(t.bounds, c.bounds, 4);
  put(t.waits, c.waits, 4);
  put(t.relative, c.relative, 4);
  put(t.entry_ptr, c.tiles, 8);
  put(t.entries, c.entries, 8);
  t.bytes = at;
  return t;
}

ScratchPlaces StreamTables::scratch_places(const Counts& c) const {
  ScratchPlaces s;
  constexpr Offset kControlBytes = (kCounters * 4 + 63) / 64 * 64;
  Offset at = 0;
  const auto put = [&](Offset& place, Offset bytes) {
    place = at;
    at += bytes;
  };
  const Offset vector = aligned(c.pivots * element_);
  put(s.pivot, vector);
  put(s.inverse_d, kind_ == Kind::ldlt ? vector : 0);
  put(s.inverse_e, kind_ == Kind::ldlt ? vector : 0);
  put(s.replaced, aligned(c.pivots));
  put(s.failed, aligned(c.pivots));
  put(s.control, kControlBytes);
  s.part_flags = c.flags + c.set_flags;
  s.set_flags = c.set_flags;
  put(s.flags, s.part_flags * (kind_ == Kind::lu ? 8 : 4));
  put(s.finished, c.fronts * 4);
  s.bytes = aligned(at);
  s.pivots = c.pivots;
  return s;
}

TablePlaces StreamTables::tables(const analysis::InCoreStep& step) const { return places(count(step)); }
ScratchPlaces StreamTables::scratch(const analysis::InCoreStep& step) const { return scratch_places(count(step)); }
TablePlaces StreamTables::tables(Index f, Index begin, Index end) const { return places(count(f, begin, end)); }
ScratchPlaces StreamTables::scratch(Index f, Index begin, Index end) const {
  return scratch_places(count(f, begin, end));
}

// The tasks of one tile column; the next diagonal tile follows as soon as what it needs has been listed.
void StreamTables::emit_column(const Front& f, std::int32_t id, Index j, std::vector<FactorTask>& tasks) const {
  const bool pivot = j < f.pivot_tiles;
  if (pivot && j == 0) tasks.push_back(task_of(id, Work::diagonal, 0, 0, 0));
  const int from = pivot ? f.column_end(j) : f.column_begin(j);
  bool next_emitted = !pivot || j + 1 == f.pivot_tiles;
  for (Index a = f.block_of_column(j); a < f.blocks; ++a) {
    if (f.block_end(a) <= from) continue;
    for (int part = 0; part < (kind_ == Kind::lu ? 2 : 1); ++part)
      tasks.push_back(task_of(id, Work::block, part, a, j));
    if (next_emitted) continue;
    tasks.push_back(task_of(id, Work::diagonal, 0, 0, j + 1));
    next_emitted = true;
  }
}

UnitTables StreamTables::build(const analysis::InCoreStep& step) const {
  UnitTables u;
  const Counts c = count(step);
  u.at = places(c);
  u.scratch = scratch_places(c);
  u.bytes.resize(static_cast<std::size_t>(u.at.bytes));
  std::vector<Front> fronts;
  std::vector<Link> links;
  std::vector<std::int32_t> bounds, waits, relative;
  std::vector<std::int64_t> entry_ptr;
  std::vector<analysis::Entry> entries;
  entries.reserve(static_cast<std::size_t>(c.entries));
  const auto internal = static_cast<Index>(step.fronts.size());
  const auto local = [&](Index f) {
    const auto& in = std::binary_search(step.fronts.begin(), step.fronts.end(), f) ? step.fronts : step.externals;
    const auto at = std::lower_bound(in.begin(), in.end(), f) - in.begin();
    return static_cast<std::int32_t>(at + (&in == &step.fronts ? 0 : internal));
  };
  const auto add_relative = [&](Front& x, Index f) {
    x.rows = static_cast<std::int64_t>(relative.size());
    const auto* from = plan_.relative.data() + plan_.tree.row_ptr[f];
    relative.insert(relative.end(), from, from + x.below);
  };
  std::int64_t flag = 0;
  std::int32_t position = 0;
  const Offset work = step.work_at / element_;
  for (Index k = 0; k < internal; ++k) {
    const Index f = step.fronts[static_cast<std::size_t>(k)];
    Front x = in_arena(device_.fronts[f]);
    x.factor = work + step.memory.factor[k];
    if (!step.memory.factor2.empty()) x.second = work + step.memory.factor2[k];
    const auto& root = step.root_at[static_cast<std::size_t>(k)];
    x.contribution = root[0] >= 0 ? root[0] / element_ : work + step.memory.contribution[k];
    if (kind_ == Kind::lu) x.contribution_up = root[0] >= 0 ? root[1] / element_ : work + step.memory.contribution2[k];
    x.flag0 = flag;
    flag += x.flags();
    x.position = position;
    position += x.pivots;
    add_relative(x, f);
    x.tile0 = static_cast<std::int64_t>(entry_ptr.size());
    const Offset first = plan_.entry_ptr[plan_.first_tile[f]];
    const auto so_far = static_cast<std::int64_t>(entries.size());
    for (Offset t = 0; t <= pivot_tile_count(f); ++t)
      entry_ptr.push_back(so_far + plan_.entry_ptr[plan_.first_tile[f] + t] - first);
    for (Offset e = first; e < plan_.entry_ptr[plan_.first_tile[f + 1]]; ++e)
      entries.push_back(with_source(plan_.entries[static_cast<std::size_t>(e)], so_far + e - first));
    const int link_begin = static_cast<int>(links.size());
    for (int l = x.link_begin; l < x.link_end; ++l) {
      const Link& from = device_.links[l];
      links.push_back({local(from.child), 0, static_cast<std::int64_t>(bounds.size())});
      bounds.insert(bounds.end(), device_.bounds.begin() + from.bound,
                    device_.bounds.begin() + from.bound + x.tiles + 1);
    }
    x.link_begin = link_begin;
    x.link_end = static_cast<int>(links.size());
    x.wait_begin = static_cast<int>(step.memory.wait_ptr[k]);
    x.wait_end = static_cast<int>(step.memory.wait_ptr[k + 1]);
    fronts.push_back(x);
  }
  for (std::size_t k = 0; k < step.externals.size(); ++k) {
    Front x = in_arena(device_.fronts[step.externals[k]]);
    x.contribution = step.external_at[k][0] / element_;
    x.contribution_up = step.external_at[k][1] / element_;
    x.flag0 = flag;
    flag += x.flags();
    add_relative(x, step.externals[k]);
    fronts.push_back(x);
  }
  waits.assign(step.memory.wait_fronts.begin(), step.memory.wait_fronts.end());
  std::vector<FactorTask> tasks;
  for (const analysis::Task& t : step.tasks) {
    const std::int32_t id = local(t.front);
    if (t.is_range())
      tasks.push_back(task_of(id, Work::whole, 0, 0, 0));
    else if (t.i == t.j)
      emit_column(fronts[static_cast<std::size_t>(id)], id, t.j, tasks);
    if (narrow_[t.front] != 0) u.narrow_end = static_cast<int>(tasks.size());
  }
  u.end = u.group_end = static_cast<int>(tasks.size());
  put(u, u.at.fronts, fronts);
  put(u, u.at.tasks, tasks);
  put(u, u.at.links, links);
  put(u, u.at.bounds, bounds);
  put(u, u.at.waits, waits);
  put(u, u.at.relative, relative);
  put(u, u.at.entry_ptr, entry_ptr);
  put(u, u.at.entries, entries);
  return u;
}

// ---- groups
// ----------------------------------------------------------------------------------------------------------

// The group as a front of its own: its pivots are the group's, its rows below all that follow. The arrays have the same
// layout as the large front's columns.
Front StreamTables::group_front(Index f, Index begin, Index end) const {
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

// The group's tasks in terms of the large front.
void StreamTables::emit_group(const Front& f, Index begin, Index end, std::vector<FactorTask>& tasks) const {
  for (Index j = begin; j < end; ++j) {
    const bool pivot = j < f.pivot_tiles;
    if (pivot) tasks.push_back(task_of(1, Work::diagonal, 0, 0, j));
    const int from = pivot ? f.column_end(j) : f.column_begin(j);
    for (Index a = f.block_of_column(j); a < f.blocks; ++a) {
      if (f.block_end(a) <= from) continue;
      for (int part = 0; part < (kind_ == Kind::lu ? 2 : 1); ++part)
        tasks.push_back(task_of(1, Work::block, part, a, j));
    }
  }
}

StreamTables::Counts StreamTables::count(Index f, Index begin, Index end) const {
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

UnitTables StreamTables::build(const analysis::ColumnGroup& g) const {
  UnitTables u;
  const Index f = g.front;
  const Counts c = count(f, g.begin, g.end);
  u.at = places(c);
  u.scratch = scratch_places(c);
  u.bytes.resize(static_cast<std::size_t>(u.at.bytes));
  const auto& l = plan_.layout[f];
  const Index pivot_end = std::min(g.end, l.pivot_tiles);
  const bool pivots = g.begin < pivot_end;
  Front whole = in_arena(device_.fronts[f]);
  u.width = whole.width;
  const Index below_begin = std::max(g.begin, l.pivot_tiles) - l.pivot_tiles;
  const Offset before = pivots ? whole.column_offset(g.begin) : 0;
  const Offset before_below = below_begin < l.tiles_below()
                                  ? whole.contribution_offset(below_begin * whole.width, below_begin * whole.width)
                                  : 0;
  whole.factor = g.factor_at[0] / element_ - before;
  whole.second = g.factor_at[1] / element_ - before;
  whole.contribution = g.contribution_at[0] / element_ - before_below;
  whole.contribution_up = g.contribution_at[1] / element_ - before_below;
  whole.tile0 = pivots ? -l.tile_index(g.begin, g.begin) : 0;
  std::vector<Front> fronts(2);
  std::vector<FactorTask> tasks;
  if (pivots) {
    Front own = group_front(f, g.begin, g.end);
    own.factor = g.factor_at[0] / element_;
    own.second = g.factor_at[1] / element_;
    own.contribution = g.contribution_at[0] / element_;
    own.contribution_up = g.contribution_at[1] / element_;
    for (Index j = 0; j < own.tiles; ++j) emit_column(own, 0, j, tasks);
    own.tasks = static_cast<std::int32_t>(tasks.size());
    fronts[0] = own;
  }
  u.end = static_cast<int>(tasks.size());
  emit_group(whole, g.begin, g.end, tasks);
  u.group_end = static_cast<int>(tasks.size());
  fronts[1] = whole;
  std::vector<Link> links;
  std::vector<std::int32_t> bounds, relative;
  for (int k = whole.link_begin; k < whole.link_end; ++k) {
    const Link& from = device_.links[k];
    Front child = in_arena(device_.fronts[from.child]);
    child.rows = static_cast<std::int64_t>(relative.size());
    const auto* rel = plan_.relative.data() + plan_.tree.row_ptr[from.child];
    relative.insert(relative.end(), rel, rel + child.below);
    links.push_back({static_cast<std::int32_t>(fronts.size()), 0, static_cast<std::int64_t>(bounds.size())});
    bounds.insert(bounds.end(), device_.bounds.begin() + from.bound,
                  device_.bounds.begin() + from.bound + whole.tiles + 1);
    fronts.push_back(child);
  }
  std::vector<std::int64_t> entry_ptr;
  std::vector<analysis::Entry> entries;
  if (pivots) {
    const Offset first = l.tile_index(g.begin, g.begin);
    for (Offset t = 0; t < c.tiles; ++t)
      entry_ptr.push_back(plan_.entry_ptr[plan_.first_tile[f] + first + t] - g.first_entry);
    for (Offset e = 0; e < g.entries; ++e)
      entries.push_back(with_source(plan_.entries[static_cast<std::size_t>(g.first_entry + e)], e));
  }
  put(u, u.at.fronts, fronts);
  put(u, u.at.tasks, tasks);
  put(u, u.at.links, links);
  put(u, u.at.bounds, bounds);
  put(u, u.at.relative, relative);
  put(u, u.at.entry_ptr, entry_ptr);
  put(u, u.at.entries, entries);
  return u;
}

}  // namespace espalier::device::cuda

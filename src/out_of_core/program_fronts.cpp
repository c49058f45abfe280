// Large fronts of an out-of-core plan: groups of block columns, left-looking, dealt to the devices that share the
// front.
#include <algorithm>

#include "out_of_core/programmers.hpp"

namespace espalier::out_of_core {

// Bytes of block columns [begin, end) of front f.
Offset FrontProgrammer::group_bytes(Index f, Index begin, Index end) const {
  const Index pivots = p_.plan.layout[f].pivot_tiles;
  return p_.factor_bytes(f, std::min(begin, pivots), std::min(end, pivots)) * p_.factor_parts +
         p_.contribution_bytes(f, std::max(begin, pivots) - pivots, std::max(end, pivots) - pivots) *
             p_.contribution_parts;
}

Index FrontProgrammer::columns_of(Index f) const {
  return p_.plan.tree.parent[f] < 0 ? p_.plan.layout[f].pivot_tiles : p_.plan.layout[f].tiles;
}

double FrontProgrammer::elements_of(const ColumnGroup& g) const {
  return static_cast<double>(group_bytes(g.front, g.begin, g.end)) / static_cast<double>(p_.element) /
         (p_.plan.options.ldlt ? 2 : 1);
}

Index FrontProgrammer::choose_end(Index device, Index f, Index begin) const {
  const Index all = columns_of(f);
  const auto devices = static_cast<Offset>(p_.units[static_cast<std::size_t>(p_.unit)].devices.size());
  auto most = static_cast<Offset>(p_.shape.group * static_cast<double>(p_.arena_bytes(device)));
  if (devices > 1) most = std::min(most, group_bytes(f, 0, all) / (devices * p_.shape.turns));
  const Offset rest = group_bytes(f, begin, all);
  if (rest <= most) return all;
  const Offset even = rest / ((rest + most - 1) / most);
  Index end = begin + 1;
  while (end < all && group_bytes(f, begin, end) < even && group_bytes(f, begin, end + 1) <= most) ++end;
  return end;
}

// The one that is free first; among equals in turn, since whoever got the last group has more to do.
Index FrontProgrammer::next_device() const {
  const std::vector<Index>& devices = p_.units[static_cast<std::size_t>(p_.unit)].devices;
  return *std::min_element(devices.begin(), devices.end(),
                           [&](Index x, Index y) { return p_.free_at(x) < p_.free_at(y); });
}

void FrontProgrammer::write() {
  const Unit& u = p_.units[static_cast<std::size_t>(p_.unit)];
  const Index f = u.large;
  p_.factors.clear();
  if (p_.stays()) take_whole(f);
  for (const Index d : u.devices) take_chunks(d, f);
  for (Index begin = 0; begin < columns_of(f);) begin = one_group(next_device(), f, begin);
  if (p_.stays())
    keep_whole(f);
  else
    for (Segment& s : p_.factors) p_.release(s);
  p_.factors.clear();
  for (const Index d : u.devices)
    for (const Offset at : chunks_[d].at) p_.give_back(d, at, chunks_[d].bytes);
  for (Offset c = p_.plan.child_ptr[f]; c < p_.plan.child_ptr[f + 1]; ++c) p_.forget_contribution(p_.plan.children[c]);
}

// Places for all pivot columns, one array after the other, for a front whose factor stays.
void FrontProgrammer::take_whole(Index f) {
  const Offset bytes = p_.layout.sizes().factor[f] * p_.element;
  for (int k = 0; k < p_.factor_parts; ++k) whole_at_[static_cast<std::size_t>(k)] = p_.need_first(0, bytes);
}

// A solve does not ask for L D.
void FrontProgrammer::keep_whole(Index f) {
  auto& at = p_.plans.front().resident_at[static_cast<std::size_t>(f)];
  at[0] = whole_at_[0];
  if (p_.factor_parts == 1) return;
  if (p_.plan.options.unsymmetric)
    at[1] = whole_at_[1];
  else
    p_.give_back(0, whole_at_[1], p_.layout.sizes().factor[f] * p_.element);
}

// Places for slabs; one block column at least.
void FrontProgrammer::take_chunks(Index device, Index f) {
  Chunks& c = chunks_[static_cast<std::size_t>(device)];
  Offset most = p_.factor_bytes(f, 0, 1) * p_.factor_parts;
  for (Offset k = p_.plan.child_ptr[f]; k < p_.plan.child_ptr[f + 1]; ++k) {
    const Index child = p_.plan.children[k];
    if (p_.plan.layout[child].tiles_below() > 0)
      most = std::max(most, p_.contribution_bytes(child, 0, 1) * p_.contribution_parts);
  }
  const auto wanted = static_cast<Offset>(p_.shape.chunk * static_cast<double>(p_.arena_bytes(device)));
  c.bytes = Arena::round(std::max(most + 2 * Arena::kAlignment, wanted));
  c.at.clear();
  for (Offset k = 0; k < p_.shape.chunks; ++k) c.at.push_back(p_.need(device, c.bytes));
  c.next = 0;
}

Offset FrontProgrammer::next_chunk(Index device) {
  Chunks& c = chunks_[static_cast<std::size_t>(device)];
  const Offset at = c.at[c.next];
  c.next = (c.next + 1) % c.at.size();
  return at;
}

// All places of a group, or none.
bool FrontProgrammer::place(Index device, ColumnGroup& g, Offset tables, Offset scratch) {
  struct Taken {
    Offset* at;
    Offset bytes;
  };
  const Index f = g.front, pivots = p_.plan.layout[f].pivot_tiles;
  std::vector<Taken> taken;
  const auto region = [&](Offset& at, Offset bytes, bool lasting) {
    at = p_.take(device, bytes, lasting);
    if (at >= 0) {
      taken.push_back({&at, bytes});
      return true;
    }
    for (const Taken& t : taken) p_.give_back(device, *t.at, t.bytes);
    return false;
  };
  const Offset factor = p_.factor_bytes(f, std::min(g.begin, pivots), std::min(g.end, pivots));
  const Offset below = p_.contribution_bytes(f, std::max(g.begin, pivots) - pivots, std::max(g.end, pivots) - pivots);
  bool good = region(g.tables_at, tables, false) &&
              region(g.values_at, p_.layout.copies_values() ? g.entries * p_.element : 0, false) &&
              region(g.scratch_at, scratch, false);
  for (int k = 0; good && k < p_.factor_parts; ++k)
    if (p_.stays())
      g.factor_at[k] = whole_at_[static_cast<std::size_t>(k)] + p_.factor_bytes(f, 0, std::min(g.begin, pivots));
    else
      good = region(g.factor_at[k], factor, false);
  for (int k = 0; good && k < p_.contribution_parts; ++k) good = region(g.contribution_at[k], below, true);
  return good;
}

void FrontProgrammer::count_entries(ColumnGroup& g) const {
  const plan::FrontLayout& l = p_.plan.layout[g.front];
  const Index end = std::min(g.end, l.pivot_tiles);
  g.first_entry = g.entries = 0;
  if (g.begin >= end) return;
  const Offset* ptr = p_.plan.entry_ptr.data() + p_.plan.first_tile[g.front];
  g.first_entry = ptr[l.tile_index(g.begin, g.begin)];
  g.entries = (end < l.tiles ? ptr[l.tile_index(end, end)] : ptr[l.tile_count()]) - g.first_entry;
}

Index FrontProgrammer::one_group(Index device, Index f, Index begin) {
  Group g;
  g.device = device;
  ColumnGroup& c = g.columns;
  c.front = f;
  c.begin = begin;
  for (c.end = choose_end(device, f, begin);; c.end = begin + (c.end - begin) / 2) {
    if (c.end == begin) throw NoRoom{};
    count_entries(c);
    if (place(device, c, p_.layout.table_bytes(f, c.begin, c.end), p_.layout.scratch_bytes(f, c.begin, c.end))) break;
  }
  auto& groups = p_.plans[static_cast<std::size_t>(device)].groups;
  g.op.unit = static_cast<Index>(groups.size());
  g.op.grouped = true;
  groups.push_back(c);
  p_.load_inputs(device, g.op, c.tables_at, p_.layout.table_bytes(f, c.begin, c.end), c.values_at,
                 p_.layout.copies_values() ? c.entries : 0);
  run(g, OperationType::begin_group, g.op, {}, 0);
  for (Offset k = p_.plan.child_ptr[f]; k < p_.plan.child_ptr[f + 1]; ++k) add_child(g, p_.plan.children[k]);
  update(g);
  finish(g);
  return c.end;
}

// An operation on the group's arrays that reads `reads` besides.
void FrontProgrammer::run(const Group& g, OperationType type, const Operation& more, std::vector<Access> reads,
                          double flops, double chain) {
  const ColumnGroup& c = g.columns;
  const Index f = c.front, pivots = p_.plan.layout[f].pivot_tiles;
  const Offset factor = p_.factor_bytes(f, std::min(c.begin, pivots), std::min(c.end, pivots));
  const Offset below = p_.contribution_bytes(f, std::max(c.begin, pivots) - pivots, std::max(c.end, pivots) - pivots);
  for (int k = 0; k < p_.factor_parts; ++k) reads.push_back({c.factor_at[k], factor, true});
  for (int k = 0; k < p_.contribution_parts; ++k) reads.push_back({c.contribution_at[k], below, true});
  reads.push_back({c.tables_at, p_.layout.table_bytes(f, c.begin, c.end), false});
  reads.push_back({c.values_at, p_.layout.copies_values() ? c.entries * p_.element : 0, false});
  reads.push_back({c.scratch_at, p_.layout.scratch_bytes(f, c.begin, c.end), true});
  Operation op = more;
  op.type = type;
  p_.emit(g.device, op, reads, {}, flops, chain);
}

// ---- children -------------------------------------------------------------------------------------------------------

// First of the child's rows below that goes to block row `row` of its parent or later.
Index FrontProgrammer::first_row(Index child, Index parent, Index row) const {
  const Index* rel = p_.plan.relative.data() + p_.plan.tree.row_ptr[child];
  const Index below = p_.plan.tree.rows_below(child);
  return static_cast<Index>(std::lower_bound(rel, rel + below, p_.plan.layout[parent].begin(row)) - rel);
}

// The child's columns that fall into the group, one segment after another.
void FrontProgrammer::add_child(const Group& g, Index child) {
  const ColumnGroup& c = g.columns;
  const Index r0 = first_row(child, c.front, c.begin), r1 = first_row(child, c.front, c.end);
  if (r0 == r1) return;
  const Index width = p_.plan.layout[child].below_width;
  const Index b0 = r0 / width, b1 = (r1 - 1) / width + 1;
  for (Segment& s : p_.contributions[child]) {
    const Index first = std::max(b0, s.begin), last = std::min(b1, s.end);
    for (Index b = first; b < last;) b = add_columns(g, s, b, last);
  }
  for (Segment& s : p_.contributions[child])
    if (s.begin < s.end && (c.end == columns_of(c.front) || s.end * width <= r1)) p_.forget(s);
}

// Adds columns of a segment from `begin` on, as many as a chunk holds where they come from the host.
Index FrontProgrammer::add_columns(const Group& g, const Segment& s, Index begin, Index last) {
  const bool two = p_.contribution_parts == 2;
  Operation op = g.op;
  op.front = s.front;
  op.begin = begin;
  op.end = last;
  if (s.resident && s.device == g.device) {
    p_.read_in_place(s);
    const Offset skip = p_.contribution_bytes(s.front, s.begin, begin);
    op.at = {s.at[0] + skip, two ? s.at[1] + skip : -1};
  } else {
    op.end = begin + 1;
    const auto fits = [&](Index end) {
      return Arena::round(p_.contribution_bytes(s.front, begin, end)) * p_.contribution_parts <=
             chunks_[g.device].bytes;
    };
    while (op.end < last && fits(op.end + 1)) ++op.end;
    const Offset at = next_chunk(g.device);
    op.at = {at, two ? at + Arena::round(p_.contribution_bytes(s.front, begin, op.end)) : -1};
    p_.load_contribution(s, g.device, begin, op.end, op.at);
  }
  const Offset bytes = p_.contribution_bytes(s.front, begin, op.end);
  std::vector<Access> reads{{op.at[0], bytes, false}};
  if (two) reads.push_back({op.at[1], bytes, false});
  run(g, OperationType::add_child, op, std::move(reads), 0);
  return op.end;
}

// ---- slabs of the pivot columns of earlier groups
// --------------------------------------------------------------------

void FrontProgrammer::update(const Group& g) {
  for (std::size_t k = 0; k < p_.factors.size(); ++k) {
    const Segment& s = p_.factors[k];
    for (Index b = s.begin; b < s.end;) b = update_columns(g, s, b);
  }
}

Offset FrontProgrammer::slab_bytes(Index f, Index begin, Index end, Index row) {
  extents_.clear();
  p_.layout.slab(f, begin, end, row, extents_);
  Offset sum = 0;
  for (const Extent& p : extents_) sum += p.size;
  return sum * p_.element;
}

Index FrontProgrammer::update_columns(const Group& g, const Segment& s, Index begin) {
  const ColumnGroup& c = g.columns;
  const bool two = p_.factor_parts == 2;
  Operation op = g.op;
  op.front = c.front;
  op.begin = begin;
  op.end = s.end;
  op.row = c.begin;
  std::vector<Access> reads;
  if (s.resident && s.device == g.device) {
    op.at = s.at;
    op.begin = s.begin;
    for (int k = 0; k < p_.factor_parts; ++k) reads.push_back({s.at[k], s.part_bytes, false});
  } else {
    op.end = begin + 1;
    while (op.end < s.end &&
           Arena::round(slab_bytes(c.front, begin, op.end + 1, c.begin)) * p_.factor_parts <= chunks_[g.device].bytes)
      ++op.end;
    const Offset bytes = slab_bytes(c.front, begin, op.end, c.begin);
    const Offset at = next_chunk(g.device);
    op.at = {at, two ? at + Arena::round(bytes) : -1};
    op.slab = true;
    load_slab(g.device, op, bytes);
    for (int k = 0; k < p_.factor_parts; ++k) reads.push_back({op.at[k], bytes, false});
  }
  const plan::FrontLayout& l = p_.plan.layout[c.front];
  const double depth = l.begin(op.end) - l.begin(op.begin);
  run(g, OperationType::update, op, std::move(reads), 2 * depth * elements_of(c));
  return op.end;
}

void FrontProgrammer::load_slab(Index device, const Operation& of, Offset bytes) {
  const bool two = p_.factor_parts == 2;
  const OutOfCorePlan& plan = p_.plans[static_cast<std::size_t>(device)];
  Operation op = of;
  op.type = OperationType::load_slab;
  op.bytes = bytes * p_.factor_parts;
  op.host = {plan.factor_store[of.front], two ? plan.factor2_store[of.front] : -1};
  const Offset from = p_.layout.factor_offset(of.front, of.begin),
               size = p_.layout.factor_offset(of.front, of.end) - from;
  p_.emit(device, op, std::array<Access, 2>{{{op.at[0], bytes, true}, {two ? op.at[1] : -1, bytes, true}}},
          std::array<Access, 2>{{{op.host[0] + from, size, false}, {two ? op.host[1] + from : -1, size, false}}});
}

// ---- the group's own pivots -----------------------------------------------------------------------------------------

void FrontProgrammer::finish(const Group& g) {
  const ColumnGroup& c = g.columns;
  const Index f = c.front, pivots = p_.plan.layout[f].pivot_tiles, end = std::min(c.end, pivots);
  const plan::FrontLayout& l = p_.plan.layout[f];
  const double depth = c.begin < end ? l.begin(end) - l.begin(c.begin) : 0;
  run(g, OperationType::eliminate_group, g.op, {}, depth * elements_of(c), depth * p_.rates.chain);
  if (c.begin < end) {
    store(g, end);
    p_.store_outputs(g.device, g.op, c.scratch_at, p_.layout.output_bytes(f, c.begin, c.end));
  }
  p_.give_back(g.device, c.tables_at, p_.layout.table_bytes(f, c.begin, c.end));
  if (p_.layout.copies_values()) p_.give_back(g.device, c.values_at, c.entries * p_.element);
  p_.give_back(g.device, c.scratch_at, p_.layout.scratch_bytes(f, c.begin, c.end));
  if (c.end <= pivots) return;
  const Index first = std::max(c.begin, pivots) - pivots;
  p_.add_contribution(f, g.device, first, c.end - pivots,
                      {c.contribution_at[0], p_.contribution_parts == 2 ? c.contribution_at[1] : -1},
                      p_.contribution_bytes(f, first, c.end - pivots));
}

// Where others wait for the columns, they go in parts, of which the next device takes the first while the last are
// still on their way.
void FrontProgrammer::store(const Group& g, Index end) {
  const ColumnGroup& c = g.columns;
  const Index f = c.front;
  const bool two = p_.factor_parts == 2, shared = p_.units[static_cast<std::size_t>(p_.unit)].devices.size() > 1;
  const OutOfCorePlan& plan = p_.plans[static_cast<std::size_t>(g.device)];
  for (Index begin = p_.stays() ? end : c.begin; begin < end;) {
    Index last = shared ? begin + 1 : end;
    while (last < end && p_.factor_bytes(f, begin, last + 1) * p_.factor_parts <= chunks_[g.device].bytes) ++last;
    Operation op = g.op;
    op.type = OperationType::store_factor;
    const Offset from = p_.layout.factor_offset(f, begin), bytes = p_.factor_bytes(f, begin, last);
    const Offset skip = p_.factor_bytes(f, c.begin, begin);
    op.at = {c.factor_at[0] + skip, two ? c.factor_at[1] + skip : -1};
    op.host = {plan.factor_store[f] + from, two ? plan.factor2_store[f] + from : -1};
    op.bytes = bytes * p_.factor_parts;
    op.front = f;
    op.begin = begin;
    op.end = last;
    p_.emit(g.device, op, std::array<Access, 2>{{{op.at[0], bytes, false}, {op.at[1], bytes, false}}},
            std::array<Access, 2>{{{op.host[0], bytes / p_.element, true}, {op.host[1], bytes / p_.element, true}}});
    begin = last;
  }
  Segment s;
  s.front = f;
  s.factor = true;
  s.device = g.device;
  s.begin = c.begin;
  s.end = end;
  s.at = {c.factor_at[0], two ? c.factor_at[1] : -1};
  s.part_bytes = p_.factor_bytes(f, c.begin, end);
  s.next_unit = p_.unit;
  s.stored = true;
  s.pinned = p_.stays() ? 1 : 0;
  p_.factors.push_back(s);
}

}  // namespace espalier::out_of_core

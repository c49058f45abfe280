#include "analysis/streaming_plan.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <map>

#include "analysis/stream_arena.hpp"
#include "analysis/streaming_cut.hpp"

namespace espalier::analysis {

namespace {

struct NoRoom {};

// What a plan is made with; the candidates differ in it.
struct Shape {
  double step = 0.3;    // bytes of an in-core step, of the arena
  double group = 0.4;   // bytes of a group, likewise
  Offset chunk = 0;     // bytes of a chunk that streams past; raised to one block column
  int chunks = 3;       // chunks on the device at one time
  bool frugal = false;  // contributions go to the host at once
  int lanes = 1;        // queues that compute
  bool around = false;  // see StreamArena
};

// Columns of a front that lie on the device, the host or both.
struct Segment {
  Index front = 0;
  bool factor = false;  // else contribution
  Index begin = 0, end = 0;
  std::array<Offset, 2> at{-1, -1};    // device
  std::array<Offset, 2> host{-1, -1};  // elements of the store
  Offset part_bytes = 0;
  Index next_unit = 0;  // where it is needed next
  bool resident = true;
  bool stored = false;
  int pinned = 0;
};

class Programmer {
 public:
  Programmer(const StreamLayout& layout, const std::vector<StreamUnit>& units, const std::vector<InCoreStep>& steps,
             Offset budget, const Shape& shape, const StreamRates& rates)
      : layout_(layout),
        plan_(layout.plan()),
        units_(units),
        shape_(shape),
        rates_(rates),
        arena_(budget, shape.around),
        host_arena_(std::numeric_limits<Offset>::max() / 4),
        element_(layout.element_bytes()),
        contribution_parts_(plan_.options.unsymmetric ? 2 : 1),
        factor_parts_(plan_.options.unsymmetric || plan_.options.ldlt ? 2 : 1) {
    p_.steps = steps;
    p_.factor_store.assign(static_cast<std::size_t>(plan_.fronts()), -1);
    p_.factor2_store.assign(static_cast<std::size_t>(plan_.fronts()), -1);
    contributions_.resize(static_cast<std::size_t>(plan_.fronts()));
    unit_of_.assign(static_cast<std::size_t>(plan_.fronts()), -1);
    chain_.assign(static_cast<std::size_t>(plan_.fronts()), 0);
    p_.lanes = shape.lanes;
    for (std::size_t u = 0; u < units.size(); ++u) {
      for (const Index f : units[u].fronts) unit_of_[f] = static_cast<Index>(u);
      if (units[u].large >= 0) unit_of_[units[u].large] = static_cast<Index>(u);
    }
  }

  StreamingPlan run() {
    p_.shared_at = need(StreamArena::kAlignment, true);
    lay_out_store();
    for (now_ = 0; now_ < static_cast<Index>(units_.size()); ++now_) {
      if (units_[now_].large >= 0)
        large_front(units_[now_].large);
      else
        in_core_step(p_.steps[now_]);
    }
    p_.arena_bytes = arena_.peak();
    p_.store_elements = p_.factor_elements + host_arena_.peak() / element_;
    for (const double s : clock_) p_.predicted_seconds = std::max(p_.predicted_seconds, s);
    p_.link_seconds = std::max(static_cast<double>(p_.bytes_in) / rates_.bytes_in,
                               static_cast<double>(p_.bytes_out) / rates_.bytes_out);
    return std::move(p_);
  }

 private:
  struct Access {
    Offset at, bytes;
    bool write;
  };

  // ---- the host's store ---------------------------------------------------------------------------------------------

  // Factors first, in the order of the units; contributions come and go behind them.
  void lay_out_store() {
    Offset at = 0;
    for (std::size_t u = 0; u < units_.size(); ++u) {
      if (const Index f = units_[u].large; f >= 0) {
        p_.factor_store[f] = at;
        at += layout_.sizes().factor[f];
        if (factor_parts_ == 2) {
          p_.factor2_store[f] = at;
          at += layout_.sizes().factor[f];
        }
        continue;
      }
      InCoreStep& s = p_.steps[u];
      s.store_at = at;
      for (std::size_t k = 0; k < s.fronts.size(); ++k) {
        p_.factor_store[s.fronts[k]] = at + s.memory.factor[k];
        if (plan_.options.unsymmetric) p_.factor2_store[s.fronts[k]] = at + s.memory.factor2[k];
      }
      at += s.memory.factor_size;
    }
    constexpr Offset kLine = 64;  // elements
    p_.factor_elements = (at + kLine - 1) / kLine * kLine;
  }

  // ---- operations ---------------------------------------------------------------------------------------------------

  // Appends an operation: device places that it touches, elements of the store likewise; what it computes, and the
  // seconds that its longest chain of pivots takes however many compute.
  void emit(StreamOp op, std::initializer_list<Access> device, std::initializer_list<Access> host, double flops = 0,
            double chain = 0) {
    op.queue = queue_for(op.work);
    const auto q = static_cast<std::size_t>(op.queue);
    const std::int64_t number = ++count_[q];
    for (const Access& a : device)
      if (a.at >= 0)
        device_touches_.touch(a.at, StreamArena::round(a.bytes), static_cast<int>(q), number, a.write, op.waits);
    for (const Access& a : host)
      if (a.at >= 0) host_touches_.touch(a.at, a.bytes, static_cast<int>(q), number, a.write, op.waits);
    double begin = clock_[q];
    for (std::size_t other = 0; other < kStreamQueues; ++other)
      if (other != q && op.waits[other] > 0)
        begin = std::max(begin, finished_[other][static_cast<std::size_t>(op.waits[other] - 1)]);
    clock_[q] = begin + rates_.start + seconds_of(op, flops, chain);
    if (op.queue == StreamQueue::in) p_.bytes_in += op.bytes;
    if (op.queue == StreamQueue::out) p_.bytes_out += op.bytes;
    finished_[q].push_back(clock_[q]);
    p_.ops.push_back(op);
  }

  [[nodiscard]] double seconds_of(const StreamOp& op, double flops, double chain) const {
    if (op.queue == StreamQueue::in) return static_cast<double>(op.bytes) / rates_.bytes_in;
    if (op.queue == StreamQueue::out) return static_cast<double>(op.bytes) / rates_.bytes_out;
    const bool shared = op.work == StreamWork::eliminate && shape_.lanes == 2;  // half of the machine each
    return shared ? std::max(chain, 2 * flops / rates_.flops) : flops / rates_.flops + chain / 2;
  }

  [[nodiscard]] StreamQueue queue_for(StreamWork work) const {
    switch (work) {
      case StreamWork::load_tables:
      case StreamWork::load_values:
      case StreamWork::load_panel:
      case StreamWork::load_contribution:
        return StreamQueue::in;
      case StreamWork::store_factor:
      case StreamWork::store_contribution:
      case StreamWork::store_outputs:
        return StreamQueue::out;
      default:
        return shape_.lanes == 2 && now_ % 2 == 1 ? StreamQueue::second_run : StreamQueue::run;
    }
  }

  [[nodiscard]] StreamOp op_of_unit(StreamWork work) const {
    StreamOp op;
    op.work = work;
    op.unit = group_ >= 0 ? group_ : now_;
    op.grouped = group_ >= 0;
    return op;
  }

  // ---- memory -------------------------------------------------------------------------------------------------------

  Offset take(Offset bytes, bool lasting) {
    for (;;) {
      const Offset at = lasting ? arena_.take_lasting(bytes) : arena_.take_passing(bytes);
      if (at >= 0) return at;
      if (!evict_one()) return -1;
    }
  }
  Offset need(Offset bytes, bool lasting = false) {
    const Offset at = take(bytes, lasting);
    if (at < 0) throw NoRoom{};
    return at;
  }

  // Sends away what is needed last. @returns false when nothing can go
  bool evict_one() {
    Segment* worst = nullptr;
    const auto ask = [&](Segment& s) {
      if (s.resident && s.pinned == 0 && (worst == nullptr || s.next_unit > worst->next_unit)) worst = &s;
    };
    for (const Index f : held_)
      for (Segment& s : contributions_[f]) ask(s);
    for (Segment& s : factors_) ask(s);
    if (worst == nullptr) return false;
    leave(*worst);
    return true;
  }

  // To the host, if it is not there yet; its place is free afterwards.
  void leave(Segment& s) {
    if (!s.stored) store_contribution(s);
    release(s);
  }
  void release(Segment& s) {
    if (!s.resident) return;
    for (int k = 0; k < parts_of(s); ++k) arena_.give_back(s.at[k], s.part_bytes);
    s.resident = false;
  }
  [[nodiscard]] int parts_of(const Segment& s) const { return s.factor ? factor_parts_ : contribution_parts_; }

  [[nodiscard]] Offset contribution_bytes(Index f, Index begin, Index end) const {
    return (layout_.contribution_offset(f, end) - layout_.contribution_offset(f, begin)) * element_;
  }
  [[nodiscard]] Offset factor_bytes(Index f, Index begin, Index end) const {
    return (layout_.factor_offset(f, end) - layout_.factor_offset(f, begin)) * element_;
  }

  void store_contribution(Segment& s) {
    for (int k = 0; k < contribution_parts_; ++k)
      s.host[k] = p_.factor_elements + host_arena_.take_lowest(s.part_bytes) / element_;
    StreamOp op;
    op.work = StreamWork::store_contribution;
    op.front = s.front;
    op.begin = s.begin;
    op.end = s.end;
    op.at = s.at;
    op.host = s.host;
    op.bytes = s.part_bytes * contribution_parts_;
    const Offset elements = s.part_bytes / element_;
    emit(op, {{s.at[0], s.part_bytes, false}, {contribution_parts_ == 2 ? s.at[1] : -1, s.part_bytes, false}},
         {{s.host[0], elements, true}, {s.host[1], elements, true}});
    s.stored = true;
  }

  // The contribution has been used up.
  void forget(Segment& s) {
    release(s);
    if (s.stored)
      for (int k = 0; k < contribution_parts_; ++k)
        host_arena_.give_back((s.host[k] - p_.factor_elements) * element_, s.part_bytes);
    s.stored = false;
    s.begin = s.end;
  }
  void forget_contribution(Index f) {
    for (Segment& s : contributions_[f]) forget(s);
    contributions_[f].clear();
    std::erase(held_, f);
  }

  void add_segment(Index f, Index begin, Index end, const std::array<Offset, 2>& at, Offset bytes) {
    Segment s;
    s.front = f;
    s.begin = begin;
    s.end = end;
    s.at = at;
    s.part_bytes = bytes;
    s.next_unit = unit_of_[plan_.tree.parent[f]];
    if (contributions_[f].empty()) held_.push_back(f);
    contributions_[f].push_back(s);
    if (shape_.frugal) leave(contributions_[f].back());
  }

  // ---- in-core steps ------------------------------------------------------------------------------------------------

  // The whole contribution of a child in one place.
  std::array<Offset, 2> bring_external(Index child, std::vector<Access>& loaded) {
    auto& list = contributions_[child];
    if (list.size() == 1 && list[0].resident) {
      ++list[0].pinned;
      return list[0].at;
    }
    const Offset bytes = StreamArena::round(layout_.sizes().contribution[child] * element_);
    const Offset at = need(bytes * contribution_parts_);
    loaded.push_back({at, bytes * contribution_parts_, true});
    for (Segment& s : list) {
      if (!s.stored) store_contribution(s);
      release(s);
      const Offset from = layout_.contribution_offset(child, s.begin) * element_;
      load_contribution(s, s.begin, s.end, {at + from, contribution_parts_ == 2 ? at + bytes + from : -1});
    }
    return {at, contribution_parts_ == 2 ? at + bytes : -1};
  }

  void load_contribution(const Segment& s, Index begin, Index end, const std::array<Offset, 2>& at) {
    const Offset skip = contribution_bytes(s.front, s.begin, begin) / element_;
    const Offset bytes = contribution_bytes(s.front, begin, end);
    StreamOp op;
    op.work = StreamWork::load_contribution;
    op.front = s.front;
    op.begin = begin;
    op.end = end;
    op.at = at;
    for (int k = 0; k < contribution_parts_; ++k) op.host[k] = s.host[k] + skip;
    op.bytes = bytes * contribution_parts_;
    const bool two = contribution_parts_ == 2;
    emit(op, {{at[0], bytes, true}, {two ? at[1] : -1, bytes, true}},
         {{op.host[0], bytes / element_, false}, {two ? op.host[1] : -1, bytes / element_, false}});
  }

  void load_inputs(Offset tables_at, Offset tables, Offset values_at, Offset entries) {
    StreamOp op = op_of_unit(StreamWork::load_tables);
    op.at[0] = tables_at;
    op.bytes = tables;
    if (tables > 0) emit(op, {{tables_at, tables, true}}, {});
    op.work = StreamWork::load_values;
    op.at[0] = values_at;
    op.bytes = entries * element_;
    if (op.bytes > 0) emit(op, {{values_at, op.bytes, true}}, {});
  }
  void store_outputs(Offset scratch_at, Offset bytes) {
    StreamOp op = op_of_unit(StreamWork::store_outputs);
    op.at[0] = scratch_at;
    op.bytes = bytes;
    if (bytes > 0) emit(op, {{scratch_at, bytes, false}}, {});
  }

  void in_core_step(InCoreStep& s) {
    group_ = -1;
    std::vector<Access> loaded;
    for (std::size_t k = 0; k < s.externals.size(); ++k) s.external_at[k] = bring_external(s.externals[k], loaded);
    const Offset tables = layout_.table_bytes(s), scratch = layout_.scratch_bytes(s);
    const Offset values = layout_.copies_values() ? s.entries : 0, work = s.memory.size * element_;
    std::vector<Access> touched;
    const auto region = [&](Offset& at, Offset bytes, bool lasting, bool write) {
      at = need(bytes, lasting);
      touched.push_back({at, bytes, write});
    };
    region(s.tables_at, tables, false, false);
    region(s.values_at, values * element_, false, false);
    region(s.scratch_at, scratch, false, true);
    region(s.work_at, work, false, true);
    double flops = 0, longest = 0;
    for (std::size_t k = 0; k < s.fronts.size(); ++k) {
      const Index f = s.fronts[k], parent = plan_.tree.parent[f];
      chain_[f] += plan_.layout[f].pivot_tiles * rates_.chain;
      longest = std::max(longest, chain_[f]);
      if (parent >= 0 && unit_of_[parent] == now_) chain_[parent] = std::max(chain_[parent], chain_[f]);
      flops += front_flops(plan_.layout[f].pivots, plan_.layout[f].rows, plan_.options.unsymmetric);
      if (!leaves_step(f)) continue;
      const Offset bytes = StreamArena::round(layout_.sizes().contribution[f] * element_);
      region(s.root_at[k][0], bytes * contribution_parts_, true, true);
      if (contribution_parts_ == 2) s.root_at[k][1] = s.root_at[k][0] + bytes;
    }
    for (const Access& a : loaded) touched.push_back({a.at, a.bytes, false});
    for (const Index child : s.externals)
      for (const Segment& g : contributions_[child])
        for (int k = 0; g.resident && k < contribution_parts_; ++k) touched.push_back({g.at[k], g.part_bytes, false});
    load_inputs(s.tables_at, tables, s.values_at, values);
    eliminate(touched, flops, longest);
    finish_step(s, tables, values, scratch, work, loaded);
  }

  [[nodiscard]] bool leaves_step(Index f) const {
    const Index parent = plan_.tree.parent[f];
    return parent >= 0 && unit_of_[parent] != now_ && plan_.tree.rows_below(f) > 0;
  }

  void eliminate(const std::vector<Access>& touched, double flops, double chain) {
    StreamOp op = op_of_unit(StreamWork::eliminate);
    const auto q = static_cast<std::size_t>(queue_for(op.work));
    for (const Access& a : touched)
      if (a.bytes > 0) device_touches_.touch(a.at, StreamArena::round(a.bytes), q, count_[q] + 1, a.write, op.waits);
    emit(op, {}, {}, flops, chain);
  }

  void finish_step(InCoreStep& s, Offset tables, Offset values, Offset scratch, Offset work,
                   const std::vector<Access>& loaded) {
    store_outputs(s.scratch_at, layout_.output_bytes(s));
    StreamOp op = op_of_unit(StreamWork::store_factor);
    op.at[0] = s.work_at;
    op.host[0] = s.store_at;
    op.bytes = s.memory.factor_size * element_;
    if (op.bytes > 0) emit(op, {{s.work_at, op.bytes, false}}, {{s.store_at, s.memory.factor_size, true}});
    arena_.give_back(s.tables_at, tables);
    arena_.give_back(s.values_at, values * element_);
    arena_.give_back(s.scratch_at, scratch);
    arena_.give_back(s.work_at, work);
    for (const Access& a : loaded) arena_.give_back(a.at, a.bytes);
    for (const Index child : s.externals) forget_contribution(child);
    for (std::size_t k = 0; k < s.fronts.size(); ++k) {
      const Index f = s.fronts[k];
      if (s.root_at[k][0] < 0) continue;
      const Offset bytes = StreamArena::round(layout_.sizes().contribution[f] * element_);
      add_segment(f, 0, plan_.layout[f].tiles_below(), s.root_at[k], bytes);
    }
  }

  // ---- large fronts -------------------------------------------------------------------------------------------------

  // Block columns of the group of front f that begins at `begin`.
  [[nodiscard]] Offset group_bytes(Index f, Index begin, Index end) const {
    const Index pivots = plan_.layout[f].pivot_tiles;
    return factor_bytes(f, std::min(begin, pivots), std::min(end, pivots)) * factor_parts_ +
           contribution_bytes(f, std::max(begin, pivots) - pivots, std::max(end, pivots) - pivots) *
               contribution_parts_;
  }
  [[nodiscard]] Index columns_of(Index f) const {
    return plan_.tree.parent[f] < 0 ? plan_.layout[f].pivot_tiles : plan_.layout[f].tiles;
  }
  [[nodiscard]] Index choose_end(Index f, Index begin) const {
    const Index all = columns_of(f);
    const auto most = static_cast<Offset>(shape_.group * static_cast<double>(arena_.size()));
    const Offset rest = group_bytes(f, begin, all);
    if (rest <= most) return all;
    const Offset even = rest / ((rest + most - 1) / most);
    Index end = begin + 1;
    while (end < all && group_bytes(f, begin, end) < even && group_bytes(f, begin, end + 1) <= most) ++end;
    return end;
  }

  void large_front(Index f) {
    factors_.clear();
    take_chunks(f);
    for (Index begin = 0; begin < columns_of(f);) begin = one_group(f, begin);
    for (Segment& s : factors_) release(s);
    factors_.clear();
    for (const Offset at : chunk_at_) arena_.give_back(at, chunk_bytes_);
    for (Offset c = plan_.child_ptr[f]; c < plan_.child_ptr[f + 1]; ++c) forget_contribution(plan_.children[c]);
    group_ = -1;
  }

  // Places for what streams past; one block column at least.
  void take_chunks(Index f) {
    Offset most = factor_bytes(f, 0, 1) * factor_parts_;
    for (Offset c = plan_.child_ptr[f]; c < plan_.child_ptr[f + 1]; ++c) {
      const Index child = plan_.children[c];
      if (plan_.layout[child].tiles_below() > 0)
        most = std::max(most, contribution_bytes(child, 0, 1) * contribution_parts_);
    }
    chunk_bytes_ = StreamArena::round(std::max(most + 2 * StreamArena::kAlignment, shape_.chunk));
    chunk_at_.clear();
    for (int k = 0; k < shape_.chunks; ++k) chunk_at_.push_back(need(chunk_bytes_));
    next_chunk_ = 0;
  }
  Offset next_chunk() {
    const Offset at = chunk_at_[next_chunk_];
    next_chunk_ = (next_chunk_ + 1) % chunk_at_.size();
    return at;
  }

  // All places of a group, or none.
  bool place_group(ColumnGroup& g, Offset tables, Offset scratch) {
    struct Taken {
      Offset* at;
      Offset bytes;
    };
    const Index f = g.front, pivots = plan_.layout[f].pivot_tiles;
    std::vector<Taken> taken;
    const auto region = [&](Offset& at, Offset bytes, bool lasting) {
      at = take(bytes, lasting);
      if (at >= 0) {
        taken.push_back({&at, bytes});
        return true;
      }
      for (const Taken& t : taken) arena_.give_back(*t.at, t.bytes);
      return false;
    };
    const Offset factor = factor_bytes(f, std::min(g.begin, pivots), std::min(g.end, pivots));
    const Offset below = contribution_bytes(f, std::max(g.begin, pivots) - pivots, std::max(g.end, pivots) - pivots);
    bool good = region(g.tables_at, tables, false) &&
                region(g.values_at, layout_.copies_values() ? g.entries * element_ : 0, false) &&
                region(g.scratch_at, scratch, false);
    for (int k = 0; good && k < factor_parts_; ++k) good = region(g.factor_at[k], factor, false);
    for (int k = 0; good && k < contribution_parts_; ++k) good = region(g.contribution_at[k], below, true);
    return good;
  }

  void count_entries(ColumnGroup& g) const {
    const FrontLayout& l = plan_.layout[g.front];
    const Index end = std::min(g.end, l.pivot_tiles);
    g.first_entry = g.entries = 0;
    if (g.begin >= end) return;
    const Offset* ptr = plan_.entry_ptr.data() + plan_.first_tile[g.front];
    g.first_entry = ptr[l.tile_index(g.begin, g.begin)];
    g.entries = (end < l.tiles ? ptr[l.tile_index(end, end)] : ptr[l.tile_count()]) - g.first_entry;
  }

  Index one_group(Index f, Index begin) {
    ColumnGroup g;
    g.front = f;
    g.begin = begin;
    g.end = choose_end(f, begin);
    for (;; g.end = begin + (g.end - begin) / 2) {
      if (g.end == begin) throw NoRoom{};
      count_entries(g);
      if (place_group(g, layout_.table_bytes(f, g.begin, g.end), layout_.scratch_bytes(f, g.begin, g.end))) break;
    }
    group_ = static_cast<Index>(p_.groups.size());
    p_.groups.push_back(g);
    const Offset tables = layout_.table_bytes(f, g.begin, g.end);
    load_inputs(g.tables_at, tables, g.values_at, layout_.copies_values() ? g.entries : 0);
    run_on_group(op_of_unit(StreamWork::begin_group), g, {}, 0);
    for (Offset c = plan_.child_ptr[f]; c < plan_.child_ptr[f + 1]; ++c) add_child(g, plan_.children[c]);
    update(g);
    finish_group(g, tables);
    return g.end;
  }

  // An operation on the group's arrays that reads `more` besides.
  void run_on_group(StreamOp op, const ColumnGroup& g, std::vector<Access> more, double flops, double chain = 0) {
    const Index pivots = plan_.layout[g.front].pivot_tiles;
    const Offset factor = factor_bytes(g.front, std::min(g.begin, pivots), std::min(g.end, pivots));
    const Offset below =
        contribution_bytes(g.front, std::max(g.begin, pivots) - pivots, std::max(g.end, pivots) - pivots);
    for (int k = 0; k < factor_parts_; ++k) more.push_back({g.factor_at[k], factor, true});
    for (int k = 0; k < contribution_parts_; ++k) more.push_back({g.contribution_at[k], below, true});
    more.push_back({g.tables_at, layout_.table_bytes(g.front, g.begin, g.end), false});
    more.push_back({g.values_at, layout_.copies_values() ? g.entries * element_ : 0, false});
    more.push_back({g.scratch_at, layout_.scratch_bytes(g.front, g.begin, g.end), true});
    const auto q = static_cast<std::size_t>(queue_for(op.work));
    for (const Access& a : more)
      if (a.bytes > 0)
        device_touches_.touch(a.at, StreamArena::round(a.bytes), static_cast<int>(q), count_[q] + 1, a.write, op.waits);
    emit(op, {}, {}, flops, chain);
  }

  // First of the child's rows below that goes to block row `row` of its parent or later.
  [[nodiscard]] Index first_row(Index child, Index parent, Index row) const {
    const Index* rel = plan_.relative.data() + plan_.tree.row_ptr[child];
    const Index below = plan_.tree.rows_below(child);
    return static_cast<Index>(std::lower_bound(rel, rel + below, plan_.layout[parent].begin(row)) - rel);
  }

  // The child's columns that fall into the group, one segment after another.
  void add_child(const ColumnGroup& g, Index child) {
    const Index r0 = first_row(child, g.front, g.begin), r1 = first_row(child, g.front, g.end);
    if (r0 == r1) return;
    const Index width = plan_.layout[child].below_width;
    const Index b0 = r0 / width, b1 = (r1 - 1) / width + 1;
    for (std::size_t k = 0; k < contributions_[child].size(); ++k) {
      const Segment& s = contributions_[child][k];
      const Index first = std::max(b0, s.begin), last = std::min(b1, s.end);
      for (Index b = first; b < last;) b = add_columns(g, s, b, last);
    }
    for (Segment& s : contributions_[child])
      if (s.begin < s.end && (g.end == columns_of(g.front) || s.end * width <= r1)) forget(s);
  }

  // Adds columns of a segment from `begin` on, as many as a chunk holds where they come from the host.
  Index add_columns(const ColumnGroup& g, const Segment& s, Index begin, Index last) {
    const bool two = contribution_parts_ == 2;
    StreamOp op = op_of_unit(StreamWork::add_child);
    op.front = s.front;
    op.begin = begin;
    op.end = last;
    if (s.resident) {
      const Offset skip = contribution_bytes(s.front, s.begin, begin);
      op.at = {s.at[0] + skip, two ? s.at[1] + skip : -1};
    } else {
      op.end = begin + 1;
      const auto fits = [&](Index end) {
        return StreamArena::round(contribution_bytes(s.front, begin, end)) * contribution_parts_ <= chunk_bytes_;
      };
      while (op.end < last && fits(op.end + 1)) ++op.end;
      const Offset at = next_chunk();
      op.at = {at, two ? at + StreamArena::round(contribution_bytes(s.front, begin, op.end)) : -1};
      load_contribution(s, begin, op.end, op.at);
    }
    const Offset bytes = contribution_bytes(s.front, begin, op.end);
    std::vector<Access> reads{{op.at[0], bytes, false}};
    if (two) reads.push_back({op.at[1], bytes, false});
    run_on_group(op, g, std::move(reads), 0);
    return op.end;
  }

  // The pivot columns of earlier groups stream past.
  void update(const ColumnGroup& g) {
    for (std::size_t k = 0; k < factors_.size(); ++k) {
      const Segment& s = factors_[k];
      for (Index b = s.begin; b < s.end;) b = update_columns(g, s, b);
    }
  }

  [[nodiscard]] Offset panel_bytes(Index f, Index begin, Index end, Index row) {
    pieces_.clear();
    layout_.panel(f, begin, end, row, pieces_);
    Offset sum = 0;
    for (const Piece& p : pieces_) sum += p.size;
    return sum * element_;
  }

  Index update_columns(const ColumnGroup& g, const Segment& s, Index begin) {
    const bool two = factor_parts_ == 2;
    StreamOp op = op_of_unit(StreamWork::update);
    op.front = g.front;
    op.begin = begin;
    op.end = s.end;
    op.row = g.begin;
    std::vector<Access> reads;
    if (s.resident) {
      op.at = s.at;
      op.begin = s.begin;
      for (int k = 0; k < factor_parts_; ++k) reads.push_back({s.at[k], s.part_bytes, false});
    } else {
      op.end = begin + 1;
      while (op.end < s.end &&
             StreamArena::round(panel_bytes(g.front, begin, op.end + 1, g.begin)) * factor_parts_ <= chunk_bytes_)
        ++op.end;
      const Offset bytes = panel_bytes(g.front, begin, op.end, g.begin);
      const Offset at = next_chunk();
      op.at = {at, two ? at + StreamArena::round(bytes) : -1};
      op.panel = true;
      load_panel(op, bytes);
      for (int k = 0; k < factor_parts_; ++k) reads.push_back({op.at[k], bytes, false});
    }
    const FrontLayout& l = plan_.layout[g.front];
    const double depth = l.begin(op.end) - l.begin(op.begin);
    const double elements = static_cast<double>(group_bytes(g.front, g.begin, g.end)) / static_cast<double>(element_) /
                            (plan_.options.ldlt ? 2 : 1);
    run_on_group(op, g, std::move(reads), 2 * depth * elements);
    return op.end;
  }

  void load_panel(const StreamOp& of, Offset bytes) {
    StreamOp op = of;
    op.work = StreamWork::load_panel;
    op.bytes = bytes * factor_parts_;
    op.host = {p_.factor_store[of.front], factor_parts_ == 2 ? p_.factor2_store[of.front] : -1};
    const Offset from = layout_.factor_offset(of.front, of.begin),
                 size = layout_.factor_offset(of.front, of.end) - from;
    const bool two = factor_parts_ == 2;
    emit(op, {{op.at[0], bytes, true}, {two ? op.at[1] : -1, bytes, true}},
         {{op.host[0] + from, size, false}, {two ? op.host[1] + from : -1, size, false}});
  }

  void finish_group(const ColumnGroup& g, Offset tables) {
    const Index f = g.front, pivots = plan_.layout[f].pivot_tiles, end = std::min(g.end, pivots);
    const FrontLayout& l = plan_.layout[f];
    const double depth = g.begin < end ? l.begin(end) - l.begin(g.begin) : 0;
    const double elements = static_cast<double>(group_bytes(f, g.begin, g.end)) / static_cast<double>(element_) /
                            (plan_.options.ldlt ? 2 : 1);
    run_on_group(op_of_unit(StreamWork::eliminate_group), g, {}, depth * elements,
                 std::max(0, end - g.begin) * rates_.chain);
    if (g.begin < end) {
      store_outputs(g.scratch_at, layout_.output_bytes(f, g.begin, g.end));
      store_group(g, end);
    }
    arena_.give_back(g.tables_at, tables);
    if (layout_.copies_values()) arena_.give_back(g.values_at, g.entries * element_);
    arena_.give_back(g.scratch_at, layout_.scratch_bytes(f, g.begin, g.end));
    if (g.end > pivots)
      add_segment(f, std::max(g.begin, pivots) - pivots, g.end - pivots,
                  {g.contribution_at[0], contribution_parts_ == 2 ? g.contribution_at[1] : -1},
                  contribution_bytes(f, std::max(g.begin, pivots) - pivots, g.end - pivots));
  }

  void store_group(const ColumnGroup& g, Index end) {
    const Index f = g.front;
    const bool two = factor_parts_ == 2;
    StreamOp op = op_of_unit(StreamWork::store_factor);
    const Offset from = layout_.factor_offset(f, g.begin), bytes = factor_bytes(f, g.begin, end);
    op.at = {g.factor_at[0], two ? g.factor_at[1] : -1};
    op.host = {p_.factor_store[f] + from, two ? p_.factor2_store[f] + from : -1};
    op.bytes = bytes * factor_parts_;
    op.front = f;
    op.begin = g.begin;
    op.end = end;
    emit(op, {{op.at[0], bytes, false}, {op.at[1], bytes, false}},
         {{op.host[0], bytes / element_, true}, {op.host[1], bytes / element_, true}});
    Segment s;
    s.front = f;
    s.factor = true;
    s.begin = g.begin;
    s.end = end;
    s.at = op.at;
    s.part_bytes = bytes;
    s.next_unit = now_;
    s.stored = true;
    factors_.push_back(s);
  }

  const StreamLayout& layout_;
  const Plan& plan_;
  const std::vector<StreamUnit>& units_;
  Shape shape_;
  StreamRates rates_;
  StreamingPlan p_;
  StreamArena arena_, host_arena_;
  Touches device_touches_, host_touches_;
  Offset element_;
  int contribution_parts_, factor_parts_;
  std::vector<Index> unit_of_;
  std::vector<std::vector<Segment>> contributions_;  // fronts
  std::vector<Index> held_;                          // fronts with contributions
  std::vector<Segment> factors_;                     // of the large front at hand
  std::vector<Offset> chunk_at_;
  std::vector<Piece> pieces_;
  Offset chunk_bytes_ = 0;
  std::size_t next_chunk_ = 0;
  Index now_ = 0, group_ = -1;
  std::vector<double> chain_;  // fronts: seconds of the longest chain of pivots below, within the step
  std::array<std::int64_t, kStreamQueues> count_{};
  std::array<double, kStreamQueues> clock_{};
  std::array<std::vector<double>, kStreamQueues> finished_;
};

// The units and steps for some sizes of steps, made once each.
class Candidates {
 public:
  Candidates(const StreamLayout& layout, const StreamRates& rates) : layout_(layout), rates_(rates) {}

  // The plan of this shape, or none.
  bool make(Offset budget, const Shape& shape, StreamingPlan& plan) {
    const auto limit = static_cast<Offset>(shape.step * static_cast<double>(budget));
    auto found = cuts_.find(limit);
    if (found == cuts_.end()) {
      Cut cut;
      cut.units = cut_for_streaming(layout_, limit);
      cut.steps = make_in_core_steps(layout_, cut.units);
      found = cuts_.emplace(limit, std::move(cut)).first;
    }
    try {
      plan = Programmer(layout_, found->second.units, found->second.steps, budget, shape, rates_).run();
      return true;
    } catch (const NoRoom&) {
      return false;
    }
  }
  void forget() { cuts_.clear(); }

 private:
  struct Cut {
    std::vector<StreamUnit> units;
    std::vector<InCoreStep> steps;
  };
  const StreamLayout& layout_;
  StreamRates rates_;
  std::map<Offset, Cut> cuts_;
};

// What takes the least memory, for budgets near the floor.
bool make_frugal(Candidates& candidates, Offset budget, StreamingPlan& plan) {
  for (const double step : {0.5, 0.25, 0.1, 0.03}) {
    const Shape shape{step, 0.3, 0, 1, true, 1, false};
    if (candidates.make(budget, shape, plan)) return true;
  }
  return false;
}

// Certainly needed: of every front a block column, or all of it.
Offset least_bytes(const StreamLayout& layout) {
  Offset least = StreamArena::kAlignment;
  for (Index f = 0; f < layout.plan().fronts(); ++f)
    least = std::max(least, layout.factor_offset(f, 1) * layout.element_bytes());
  return least;
}

}  // namespace

StreamingPlan plan_streaming(const StreamLayout& layout, Offset budget_bytes, const StreamRates& rates) {
  Candidates candidates(layout, rates);
  StreamingPlan best, plan;
  bool any = false;
  for (const double step : {0.3, 0.2, 0.1, 0.05})
    for (const double group : {0.7, 0.45, 0.3}) {
      if ((rates.step > 0 && rates.step != step) || (rates.group > 0 && rates.group != group)) continue;
      for (const bool around : {false, true}) {
        const Shape shape{step, group, budget_bytes / 32, 3, false, rates.lanes, around};
        if (!candidates.make(budget_bytes, shape, plan)) continue;
        if (!any || plan.predicted_seconds < best.predicted_seconds) best = std::move(plan);
        any = true;
      }
    }
  if (any) return best;
  if (make_frugal(candidates, budget_bytes, best)) return best;
  Offset need = std::max(budget_bytes, least_bytes(layout));
  do {
    candidates.forget();
    need += need / 8;
  } while (!make_frugal(candidates, need, plan));
  throw Error(StatusCode::out_of_memory,
              fmt::format("the budget of {} bytes of device memory is below what streaming needs: {} bytes; give it "
                          "as much with --device-memory",
                          budget_bytes, need));
}

}  // namespace espalier::analysis

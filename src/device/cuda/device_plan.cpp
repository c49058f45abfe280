#include "device/cuda/device_plan.hpp"

#include <algorithm>
#include <bit>
#include <stdexcept>

namespace espalier::device::cuda {

namespace {

using analysis::Plan;
using analysis::Task;

constexpr Index kNarrow = 32;
constexpr Index kWide = 64;

Index pad(Index x) { return (x + kChunk - 1) / kChunk * kChunk; }

class Builder {
 public:
  Builder(const Plan& plan, Kind kind) : plan_(plan), kind_(kind) {
    if (plan.options.tiles.panel != kChunk || plan.options.tiles.even || plan.options.range_flops > 0)
      throw std::invalid_argument("make_device_plan: the plan was not made with cuda_plan_options()");
  }

  DevicePlan build() {
    describe_fronts();
    link_children();
    const std::vector<Task> order = by_phase();
    place_arrays(order);
    list_tasks(order);
    list_solve_tasks();
    return std::move(d_);
  }

 private:
  [[nodiscard]] bool is_lu() const { return kind_ == Kind::lu; }

  void describe_fronts() {
    const auto& t = plan_.tree;
    d_.fronts.resize(static_cast<std::size_t>(plan_.fronts()));
    for (Index f = 0; f < plan_.fronts(); ++f) {
      Front& x = d_.fronts[f];
      const auto& layout = plan_.layout[f];
      x.pivots = layout.pivots;
      x.below = layout.below();
      x.whole = plan_.whole[f];
      x.width = x.whole != 0 ? kRowBlock : width_of(layout);
      x.width_log2 = std::countr_zero(static_cast<std::uint32_t>(x.width));
      x.pivot_pad = pad(x.pivots);
      x.total_pad = x.pivot_pad + pad(x.below);
      x.below_ld = (x.below + 3) / 4 * 4;
      x.position = t.first[f];
      x.pivot_tiles = layout.pivot_tiles;
      x.tiles = layout.tiles;
      x.pivot_blocks = (x.pivot_pad + kRowBlock - 1) / kRowBlock;
      x.blocks = x.pivot_blocks + (pad(x.below) + kRowBlock - 1) / kRowBlock;
      x.rows = t.row_ptr[f];
      x.tile0 = plan_.first_tile[f];
      x.flag0 = d_.flags;
      d_.flags += x.flags();
    }
  }

  [[nodiscard]] Index width_of(const analysis::FrontLayout& layout) const {
    const auto& rule = plan_.options.tiles;
    return layout.rows <= rule.narrow_rows ? kNarrow : kWide;
  }

  void link_children() {
    for (Index f = 0; f < plan_.fronts(); ++f) {
      Front& x = d_.fronts[f];
      x.link_begin = static_cast<std::int32_t>(d_.links.size());
      for (Offset c = plan_.child_ptr[f]; c < plan_.child_ptr[f + 1]; ++c) {
        const Index child = plan_.children[c];
        if (plan_.tree.rows_below(child) == 0) continue;
        d_.links.push_back({child, 0, static_cast<std::int64_t>(d_.bounds.size())});
        add_bounds(f, child);
      }
      x.link_end = static_cast<std::int32_t>(d_.links.size());
    }
  }

  void add_bounds(Index f, Index child) {
    const auto& t = plan_.tree;
    const auto& layout = plan_.layout[f];
    Offset r = t.row_ptr[child];
    for (Index i = 0; i <= layout.tiles; ++i) {
      const Index from = i == layout.tiles ? layout.rows : layout.begin(i);
      while (r < t.row_ptr[child + 1] && plan_.relative[r] < from) ++r;
      d_.bounds.push_back(static_cast<std::int32_t>(r - t.row_ptr[child]));
    }
  }

  // The plan's tasks, those of narrow sub-trees first; otherwise in the plan's order.
  std::vector<Task> by_phase() {
    narrow_.assign(static_cast<std::size_t>(plan_.fronts()), 1);
    for (Index f = 0; f < plan_.fronts(); ++f) {
      if (d_.fronts[f].width == kWide) narrow_[f] = 0;
      const Index p = plan_.tree.parent[f];
      if (p >= 0 && narrow_[f] == 0) narrow_[p] = 0;
    }
    std::vector<Task> order = plan_.tasks;
    std::stable_partition(order.begin(), order.end(), [&](const Task& task) { return narrow_[task.front] != 0; });
    return order;
  }

  // Places in the arena: the plan's own memory planner, over this backend's sizes and order.
  void place_arrays(const std::vector<Task>& order) {
    Plan light;
    light.tree.parent = plan_.tree.parent;
    light.options = plan_.options;
    light.layout = plan_.layout;
    light.whole = plan_.whole;
    light.child_ptr = plan_.child_ptr;
    light.children = plan_.children;
    light.tasks = order;
    const auto n = static_cast<std::size_t>(plan_.fronts());
    light.first_task.assign(n, -1);
    light.last_task.assign(n, -1);
    for (std::size_t at = 0; at < order.size(); ++at) {
      const Index f = order[at].front;
      if (light.first_task[f] < 0) light.first_task[f] = static_cast<Index>(at);
      light.last_task[f] = static_cast<Index>(at);
    }
    analysis::ArraySizes sizes;
    for (const Front& x : d_.fronts) {
      sizes.factor.push_back((x.factor_size() + kChunk - 1) / kChunk * kChunk);
      sizes.contribution.push_back((x.contribution_size() + kChunk - 1) / kChunk * kChunk);
    }
    analysis::plan_memory(light, &sizes);
    const auto& m = light.memory;
    for (Index f = 0; f < plan_.fronts(); ++f) {
      Front& x = d_.fronts[f];
      x.factor = m.factor[f];
      x.contribution = m.contribution[f];
      if (!m.factor2.empty()) x.second = m.factor2[f];
      if (!m.contribution2.empty()) x.contribution_up = m.contribution2[f];
      x.wait_begin = static_cast<std::int32_t>(m.wait_ptr[f]);
      x.wait_end = static_cast<std::int32_t>(m.wait_ptr[f + 1]);
    }
    d_.waits.assign(m.wait_fronts.begin(), m.wait_fronts.end());
    d_.regions = {m.size};
  }

  void emit(Index f, Work work, int part, Index block, Index column) {
    d_.tasks.push_back(
        {f, work, static_cast<std::int8_t>(part), static_cast<std::uint16_t>(d_.fronts[f].region), block, column});
    ++d_.fronts[f].tasks;
  }

  void emit_block(Index f, Index block, Index column) {
    emit(f, Work::block, 0, block, column);
    if (is_lu()) emit(f, Work::block, 1, block, column);
  }

  // The tasks of one tile column. The next diagonal tile follows as soon as what it needs has been listed, so that it
  // is ready when the next column begins.
  void emit_column(Index f, Index j) {
    const Front& x = d_.fronts[f];
    const bool pivot = j < x.pivot_tiles;
    if (pivot && j == 0) emit(f, Work::diagonal, 0, 0, 0);
    const int from = pivot ? x.column_end(j) : x.column_begin(j);
    bool next_emitted = !pivot || j + 1 == x.pivot_tiles;
    for (Index a = x.block_of_column(j); a < x.blocks; ++a) {
      if (x.block_end(a) <= from) continue;
      emit_block(f, a, j);
      if (next_emitted) continue;
      emit(f, Work::diagonal, 0, 0, j + 1);
      next_emitted = true;
    }
  }

  void list_tasks(const std::vector<Task>& order) {
    d_.narrow_tasks = -1;
    for (const Task& task : order) {
      if (d_.narrow_tasks < 0 && narrow_[task.front] == 0) d_.narrow_tasks = static_cast<std::int64_t>(d_.tasks.size());
      if (task.is_range())
        emit(task.front, Work::whole, 0, 0, 0);
      else if (task.i == task.j)
        emit_column(task.front, task.j);
    }
    if (d_.narrow_tasks < 0) d_.narrow_tasks = static_cast<std::int64_t>(d_.tasks.size());
  }

  // Up: children before parents, tier by tier from the deepest; down: the reverse. Sub-trees in which every front is
  // small are taken first on the way up and last on the way down.
  void list_solve_tasks() {
    std::vector<char> small(static_cast<std::size_t>(plan_.fronts()), 1);
    std::vector<Index> order(small.size());
    for (Index f = 0; f < plan_.fronts(); ++f) {
      const Front& x = d_.fronts[f];
      if (x.total_pad > kRowBlock || x.pivot_pad > kWide) small[f] = 0;
      const Index p = plan_.tree.parent[f];
      if (p >= 0 && small[f] == 0) small[p] = 0;
      order[f] = f;
    }
    std::stable_sort(order.begin(), order.end(), [&](Index a, Index b) {
      return small[a] != small[b] ? small[a] > small[b] : plan_.tier[a] > plan_.tier[b];
    });
    for (const Index f : order) {
      if (d_.fronts[f].total_pad <= kRowBlock)
        d_.up.push_back({f, -1});
      else
        for (Index a = 0; a < d_.fronts[f].blocks; ++a) d_.up.push_back({f, a});
    }
    for (auto it = order.rbegin(); it != order.rend(); ++it)
      for (Index a = d_.fronts[*it].pivot_blocks; a-- > 0;) d_.down.push_back({*it, a});
    d_.small_up = d_.small_down = std::count(small.begin(), small.end(), 1);
  }

  const Plan& plan_;
  Kind kind_;
  DevicePlan d_;
  std::vector<char> narrow_;  // fronts; 1: the front and all below it have narrow tiles
};

}  // namespace

analysis::PlanOptions cuda_plan_options(Kind kind, const DeviceTuning& tuning) {
  analysis::PlanOptions o;
  o.tiles.panel = kChunk;
  o.tiles.even = false;
  o.tiles.max_block_size = kWide;
  o.tiles.narrow_rows = tuning.narrow_rows;
  o.tiles.narrow_width = kNarrow;
  o.tiles.whole_rows = tuning.whole_rows;
  o.tiles.whole_pivots = tuning.whole_pivots;
  o.unsymmetric = kind == Kind::lu;
  o.ldlt = kind == Kind::ldlt;
  o.range_flops = 0;
  o.group_entries = tuning.group_entries;
  o.interleave = 1 << 20;
  o.reuse_distance = tuning.reuse_distance;
  return o;
}

DevicePlan make_device_plan(const analysis::Plan& plan, Kind kind) { return Builder(plan, kind).build(); }

}  // namespace espalier::device::cuda

#include "device/cuda/device_plan.hpp"

#include <algorithm>
#include <bit>
#include <limits>
#include <stdexcept>

#include "device/cuda/device_task_lists.hpp"

namespace espalier::device::cuda {

namespace {

using analysis::Plan;
using analysis::Task;

constexpr std::int64_t kFrontsPerPiece = 512;

Index pad(Index x) { return (x + kChunk - 1) / kChunk * kChunk; }
Offset rounded(Offset x) { return (x + kChunk - 1) / kChunk * kChunk; }

// The shape of front f: all that follows from its layout alone.
Front shape_of(const Plan& plan, Index f) {
  Front x;
  const auto& layout = plan.layout[f];
  x.pivots = layout.pivots;
  x.below = layout.below();
  x.whole = plan.whole[f];
  x.width = x.whole != 0 ? kRowBlock : layout.rows <= plan.options.tiles.narrow_rows ? kNarrowTiles : kWideTiles;
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

analysis::ArraySizes sizes_on_device(const Plan& plan) {
  analysis::ArraySizes sizes;
  sizes.factor.reserve(static_cast<std::size_t>(plan.fronts()));
  sizes.contribution.reserve(static_cast<std::size_t>(plan.fronts()));
  for (Index f = 0; f < plan.fronts(); ++f) {
    const Front x = shape_of(plan, f);
    sizes.factor.push_back(rounded(x.factor_size()));
    sizes.contribution.push_back(rounded(x.contribution_size()));
  }
  return sizes;
}

class Builder {
 public:
  Builder(const Plan& plan, Kind kind, bool peer_access, const TaskOrder& shape, base::ThreadPool& pool)
      : plan_(plan), kind_(kind), peer_access_(peer_access), shape_(shape), pool_(pool) {
    if (plan.options.tiles.panel != kChunk || plan.options.tiles.even || plan.options.range_flops > 0)
      throw std::invalid_argument("make_device_plan: the plan was not made with cuda_plan_options()");
  }

  DevicePlan build() {
    d_.lists.resize(static_cast<std::size_t>(plan_.assignment.devices));
    describe_fronts();
    link_children();
    name_regions();
    find_narrow();
    d_.regions.assign(d_.region_device.size(), 0);
    if (plan_.assignment.devices == 1) {
      take_places();
      list_tasks(plan_, kind_, plan_.tasks, narrow_, shape_, pool_, d_);
    } else {
      std::vector<Task> order;
      place_arrays(order);
      list_tasks(plan_, kind_, order, narrow_, shape_, pool_, d_);
    }
    list_inverses();
    return std::move(d_);
  }

 private:
  [[nodiscard]] bool is_lu() const { return kind_ == Kind::lu; }

  void describe_fronts() {
    const auto& t = plan_.tree;
    d_.fronts.resize(static_cast<std::size_t>(plan_.fronts()));
    pool_.for_each_piece(plan_.fronts(), kFrontsPerPiece, [&](std::int64_t begin, std::int64_t end) {
      for (auto f = static_cast<Index>(begin); f < end; ++f) {
        Front& x = d_.fronts[f];
        x = shape_of(plan_, f);
        x.position = t.first[f];
        x.members = 1;
        x.first_place = -1;
        x.rows = t.row_ptr[f];
        x.tile0 = plan_.first_tile[f];
      }
    });
    for (Front& x : d_.fronts) {
      x.flag0 = d_.flags;
      d_.flags += x.flags();
    }
  }

  void link_children() {
    std::int64_t bounds = 0;
    for (Index f = 0; f < plan_.fronts(); ++f) {
      Front& x = d_.fronts[f];
      x.link_begin = static_cast<std::int32_t>(d_.links.size());
      for (Offset c = plan_.child_ptr[f]; c < plan_.child_ptr[f + 1]; ++c) {
        const Index child = plan_.children[c];
        if (plan_.tree.rows_below(child) == 0) continue;
        d_.links.push_back({child, 0, bounds});
        bounds += x.tiles + 1;
      }
      x.link_end = static_cast<std::int32_t>(d_.links.size());
    }
    d_.bounds.resize(static_cast<std::size_t>(bounds));
    pool_.for_each_piece(plan_.fronts(), kFrontsPerPiece, [&](std::int64_t begin, std::int64_t end) {
      for (auto f = static_cast<Index>(begin); f < end; ++f)
        for (int l = d_.fronts[f].link_begin; l < d_.fronts[f].link_end; ++l) find_bounds(f, d_.links[l]);
    });
  }

  void find_bounds(Index f, const Link& link) {
    const auto& t = plan_.tree;
    const auto& layout = plan_.layout[f];
    const Offset first = t.row_ptr[link.child], end = t.row_ptr[link.child + 1];
    Offset r = first;
    for (Index i = 0; i <= layout.tiles; ++i) {
      const Index from = i == layout.tiles ? layout.rows : layout.begin(i);
      while (r < end && plan_.relative[r] < from) ++r;
      d_.bounds[link.bound + i] = static_cast<std::int32_t>(r - first);
    }
  }

  // Region 0 is all of it with one device. With several: 0 the top, 1 .. devices what each has for itself, then the
  // stealable sub-trees.
  void name_regions() {
    const auto& a = plan_.assignment;
    d_.region_device.assign(1, 0);
    if (a.devices > 1)
      for (Index d = 0; d < a.devices; ++d) d_.region_device.push_back(d);
    d_.first_stealable = static_cast<std::int32_t>(d_.region_device.size());
    std::vector<Index> region_of(a.subtrees.size());
    for (std::size_t s = 0; s < a.subtrees.size(); ++s) {
      region_of[s] = 1 + a.subtrees[s].device;
      if (!a.subtrees[s].apart || !peer_access_) continue;
      region_of[s] = static_cast<Index>(d_.region_device.size());
      d_.region_device.push_back(a.subtrees[s].device);
    }
    for (Index f = 0; f < plan_.fronts(); ++f)
      if (const Index s = a.subtree(f); s >= 0) d_.fronts[f].region = region_of[static_cast<std::size_t>(s)];
  }

  void find_narrow() {
    narrow_.assign(static_cast<std::size_t>(plan_.fronts()), 1);
    const bool any_wide =
        std::any_of(d_.fronts.begin(), d_.fronts.end(), [](const Front& x) { return x.width == kWideTiles; });
    // A stealable sub-tree belongs to one kernel, and to the last, by which time it shows who is behind.
    if (any_wide)
      for (Index f = 0; f < plan_.fronts(); ++f)
        if (d_.fronts[f].region >= d_.first_stealable) narrow_[f] = 0;
    for (Index f = 0; f < plan_.fronts(); ++f) {
      if (d_.fronts[f].width == kWideTiles) narrow_[f] = 0;
      const Index p = plan_.tree.parent[f];
      if (p >= 0 && narrow_[f] == 0) narrow_[p] = 0;
    }
  }

  // One device: the analysis has planned memory for these sizes in this order. A plan without memory is only listed.
  void take_places() {
    const analysis::MemoryPlan& m = plan_.memory;
    d_.regions[0] = m.size;
    if (m.factor.empty()) return;
    for (Index f = 0; f < plan_.fronts(); ++f) take_places(d_.fronts[f], m, f);
    d_.waits.assign(m.wait_fronts.begin(), m.wait_fronts.end());
  }
  static void take_places(Front& x, const analysis::MemoryPlan& m, Index k) {
    x.factor = m.factor[k];
    x.contribution = m.contribution[k];
    if (!m.factor2.empty()) x.second = m.factor2[k];
    if (!m.contribution2.empty()) x.contribution_up = m.contribution2[k];
    x.wait_begin = static_cast<std::int32_t>(m.wait_ptr[k]);
    x.wait_end = static_cast<std::int32_t>(m.wait_ptr[k + 1]);
  }

  // Several devices: the plan's tasks, those of narrow sub-trees first; otherwise in the plan's order.
  [[nodiscard]] std::vector<Task> by_phase() const {
    std::vector<Task> order = plan_.tasks;
    std::stable_partition(order.begin(), order.end(), [&](const Task& task) { return narrow_[task.front] != 0; });
    return order;
  }

  // What lies in a region, in rising order, and, when it is placed, which fronts its fronts wait for.
  struct RegionParts {
    std::vector<Index> fronts;
    std::vector<Index> waits;
  };

  // Several devices: the top and what each does alone; beside it `order`, that of all tasks.
  void place_arrays(std::vector<Task>& order) {
    std::vector<RegionParts> parts(d_.region_device.size());
    std::vector<Index> region(static_cast<std::size_t>(plan_.fronts())), local(region.size());  // number in the region
    for (Index f = 0; f < plan_.fronts(); ++f) {
      region[f] = d_.fronts[f].region;
      auto& fronts = parts[static_cast<std::size_t>(region[f])].fronts;
      local[f] = static_cast<Index>(fronts.size());
      fronts.push_back(f);
    }
    pool_.for_each(static_cast<std::int64_t>(parts.size()), [&](std::int64_t r) {
      if (r == 0)
        order = by_phase();
      else
        place_region(static_cast<Index>(r), region, local, parts[static_cast<std::size_t>(r)]);
    });
    for (std::size_t r = 1; r < parts.size(); ++r) {
      const auto first = static_cast<std::int32_t>(d_.waits.size());
      for (const Index f : parts[r].fronts) {
        d_.fronts[f].wait_begin += first;
        d_.fronts[f].wait_end += first;
      }
      for (const Index k : parts[r].waits) d_.waits.push_back(parts[r].fronts[k]);
    }
    place_top();
  }

  // One region by the plan's own memory planner, over this backend's sizes and order. What is passed on to other
  // regions hangs on a front that is never eliminated, so that it stays.
  void place_region(Index self, const std::vector<Index>& region, const std::vector<Index>& local, RegionParts& parts) {
    const auto n = parts.fronts.size();
    Plan light;
    light.options = plan_.options;
    light.options.devices = 1;
    light.tree.parent.assign(n + 1, -1);
    light.layout.resize(n + 1);
    light.whole.assign(n + 1, 1);
    light.child_ptr.assign(n + 2, 0);
    analysis::ArraySizes sizes;
    for (std::size_t k = 0; k < n; ++k) {
      const Index f = parts.fronts[k], parent = plan_.tree.parent[f];
      if (parent >= 0) light.tree.parent[k] = region[parent] == self ? local[parent] : static_cast<Index>(n);
      light.layout[k] = plan_.layout[f];
      light.whole[k] = plan_.whole[f];
      for (Offset c = plan_.child_ptr[f]; c < plan_.child_ptr[f + 1]; ++c)
        light.children.push_back(local[plan_.children[c]]);
      light.child_ptr[k + 1] = static_cast<Offset>(light.children.size());
      sizes.factor.push_back(rounded(d_.fronts[f].factor_size()));
      sizes.contribution.push_back(rounded(d_.fronts[f].contribution_size()));
    }
    light.child_ptr[n + 1] = light.child_ptr[n];
    sizes.factor.push_back(0);
    sizes.contribution.push_back(0);
    light.first_task.assign(n + 1, -1);
    light.last_task.assign(n + 1, std::numeric_limits<Index>::max());
    for (const char narrow : {1, 0})  // as by_phase()
      for (Task task : plan_.tasks) {
        if (region[task.front] != self || narrow_[task.front] != narrow) continue;
        const auto at = static_cast<Index>(light.tasks.size());
        task.front = local[task.front];
        if (task.is_range()) task.begin = task.front;
        if (light.first_task[task.front] < 0) light.first_task[task.front] = at;
        light.last_task[task.front] = at;
        light.tasks.push_back(task);
      }
    analysis::plan_memory(light, &sizes);
    const auto& m = light.memory;
    for (std::size_t k = 0; k < n; ++k) take_places(d_.fronts[parts.fronts[k]], m, static_cast<Index>(k));
    parts.waits.assign(m.wait_fronts.begin(), m.wait_fronts.end());
    d_.regions[self] = m.size;
  }

  // The top: factors one after another; tile columns of contributions with their makers. Nothing is used twice, so
  // that nobody waits for a reader on another device.
  void place_top() {
    const auto& a = plan_.assignment;
    d_.place_space.assign(static_cast<std::size_t>(a.devices), 0);
    Offset end = 0;
    for (Index f = 0; f < plan_.fronts(); ++f) {
      Front& x = d_.fronts[f];
      const Index parent = plan_.tree.parent[f];
      x.members = static_cast<std::uint16_t>(a.members[f]);
      x.readers = parent < 0 || a.subtree(parent) >= 0 ? 0 : static_cast<std::uint16_t>(a.members[parent]);
      if (x.region == 0) {
        const Offset size = rounded(x.factor_size());
        x.factor = end;
        end += size;
        if (kind_ == Kind::lu || (kind_ == Kind::ldlt && x.whole == 0)) {
          x.second = end;
          end += size;
        }
      }
      const bool apart = x.region == 0 || (!peer_access_ && x.readers != 0);
      if (!apart || parent < 0 || x.below == 0) continue;
      x.first_place = static_cast<std::int32_t>(d_.places.size());
      for (int part = 0; part < (is_lu() ? 2 : 1); ++part)
        for (int b = 0; b < x.tiles - x.pivot_tiles; ++b) {
          const Index owner = a.owner(f, x.whole != 0 ? 0 : x.pivot_tiles + b);
          const Offset first = static_cast<Offset>(b) * x.width;
          const Offset columns = std::min<Offset>(x.width, x.below - first);
          d_.places.push_back({owner, d_.place_space[owner]});
          d_.place_space[owner] += rounded(columns * (x.below_ld - first));
        }
    }
    d_.regions[0] = end;
  }

  // Fronts of L L^T that the solve takes by row blocks and whose blocks of pivots have several tiles. Not those of
  // which several devices share one copy, nor sub-trees that another device may have made.
  void list_inverses() {
    if (kind_ != Kind::llt) return;
    const auto joined = [&](const Front& f) {
      if (f.pivot_tiles < 2) return false;
      return d_.lists.size() == 1 || (f.region == 0 ? peer_access_ : f.region < d_.first_stealable);
    };
    for (TaskLists& l : d_.lists)
      for (auto task = l.up.begin() + static_cast<std::ptrdiff_t>(l.small_up); task != l.up.end(); ++task) {
        Front& f = d_.fronts[task->front];
        if (task->block < 0 || task->block >= f.pivot_blocks || !joined(f)) continue;
        f.inverted = kRowBlock;
        l.inverses.push_back(*task);
      }
  }

  const Plan& plan_;
  Kind kind_;
  bool peer_access_;
  TaskOrder shape_;
  base::ThreadPool& pool_;
  DevicePlan d_;
  std::vector<char> narrow_;  // fronts; 1: the front and all below it have narrow tiles
};

}  // namespace

analysis::PlanOptions cuda_plan_options(Kind kind, const DeviceTuning& tuning, Index devices) {
  analysis::PlanOptions o;
  o.tiles.panel = kChunk;
  o.tiles.even = false;
  o.tiles.max_block_size = kWideTiles;
  const bool all_narrow = tuning.max_block_size > 0 && tuning.max_block_size < kWideTiles;
  o.tiles.narrow_rows = all_narrow ? std::numeric_limits<Index>::max() : tuning.narrow_rows;
  o.tiles.narrow_width = kNarrowTiles;
  o.tiles.whole_rows = tuning.whole_rows;
  o.tiles.whole_pivots = kind == Kind::ldlt ? tuning.whole_pivots_ldlt : tuning.whole_pivots;
  o.unsymmetric = kind == Kind::lu;
  o.ldlt = kind == Kind::ldlt;
  o.range_flops = 0;
  o.group_entries = tuning.group_entries;
  o.interleave = 1 << 20;
  o.reuse_distance = tuning.reuse_distance;
  o.devices = devices;
  o.cost = analysis::CostModel::gpu;
  o.subtrees_apart = false;
  o.plan_memory = devices == 1;
  o.array_sizes = sizes_on_device;
  o.narrow_first = true;
  o.additional_subtrees = tuning.additional_subtrees;
  o.column_group = tuning.column_group;
  o.balance_columns = true;
  o.device_speed = tuning.device_speed;
  o.stealing = tuning.stealing;
  o.shared_top = tuning.shared_top;
  if (tuning.count_balance) o.cost = analysis::CostModel::count;
  return o;
}

DevicePlan make_device_plan(const analysis::Plan& plan, Kind kind, bool peer_access, const TaskOrder& shape,
                            base::ThreadPool* pool) {
  base::ThreadPool alone(1);
  return Builder(plan, kind, peer_access, shape, pool != nullptr ? *pool : alone).build();
}

std::vector<double> transferred_elements(const analysis::Plan& plan, Kind kind, const DevicePlan& tables) {
  std::vector<double> moved(tables.lists.size(), 0);
  if (moved.size() == 1) return moved;
  const double copies = kind == Kind::llt ? 1 : 2;
  for (Index f = 0; f < plan.fronts(); ++f) {
    const Front& x = tables.fronts[f];
    const auto others = static_cast<unsigned>(x.members);
    if (x.region == 0)
      for (Index j = 0; j < x.pivot_tiles; ++j)
        moved[static_cast<std::size_t>(plan.assignment.owner(f, j))] +=
            copies * (std::popcount(others) - 1) * (x.column_end(j) - x.column_begin(j)) *
            static_cast<double>(x.total_pad - x.column_begin(j));
    const auto readers = static_cast<unsigned>(x.readers);
    if (readers == 0) continue;
    // A reader that made a part of the contribution itself fetches only the rest.
    const double each =
        (kind == Kind::lu ? 2 : 1) * static_cast<double>(x.contribution_size()) / std::popcount(readers);
    for (std::size_t d = 0; d < moved.size(); ++d)
      if ((readers >> d & 1) != 0) moved[d] += (others >> d & 1) != 0 ? each * (1 - 1.0 / std::popcount(others)) : each;
  }
  return moved;
}

}  // namespace espalier::device::cuda

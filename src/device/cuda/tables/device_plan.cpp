#include "device/cuda/tables/device_plan.hpp"

#include <algorithm>
#include <bit>
#include <limits>
#include <stdexcept>

#include "device/cuda/tables/device_task_lists.hpp"
#include "device/cuda/tables/front_shape.hpp"
#include "plan/memory_plan.hpp"
#include "plan/regions.hpp"

namespace espalier::device::cuda {

namespace {

using plan::Plan;

constexpr std::int64_t kFrontsPerRange = 512;

class Builder {
 public:
  Builder(const Plan& plan, Kind kind, bool peer_access, const TaskOrder& shape, base::ThreadPool& pool, bool mirrored)
      : plan_(plan), kind_(kind), peer_access_(peer_access), mirrored_(mirrored), shape_(shape), pool_(pool) {
    if (plan.options.tiles.panel != kChunk || plan.options.tiles.even || plan.options.range_flops > 0)
      throw std::invalid_argument("make_device_plan: the plan was not made with cuda_plan_options()");
  }

  DevicePlan build() {
    d_.lists.resize(at(plan_.ownership.devices));
    regions_ = plan::name_regions(plan_, peer_access_ && !mirrored_);
    d_.region_device = regions_.device;
    d_.first_stealable = regions_.first_stealable;
    d_.regions.assign(d_.region_device.size(), 0);
    describe_fronts();
    link_children();
    take_places();
    if (plan_.ownership.devices > 1) place_top();
    list_tasks(plan_, kind_, regions_.narrow, shape_, pool_, d_);
    list_inverses();
    return std::move(d_);
  }

 private:
  [[nodiscard]] bool is_lu() const { return kind_ == Kind::lu; }

  void describe_fronts() {
    const auto& t = plan_.tree;
    d_.fronts.resize(at(plan_.fronts()));
    pool_.for_each_range(plan_.fronts(), kFrontsPerRange, [&](std::int64_t begin, std::int64_t end) {
      for (auto f = static_cast<Index>(begin); f < end; ++f) {
        Front& x = d_.fronts[f];
        x = shape_of(plan_.layout[f], plan_.form(f));
        x.position = t.first[f];
        x.members = 1;
        x.region = regions_.of[f];
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
    d_.bounds.resize(at(bounds));
    pool_.for_each_range(plan_.fronts(), kFrontsPerRange, [&](std::int64_t begin, std::int64_t end) {
      for (auto f = static_cast<Index>(begin); f < end; ++f)
        for (int l = d_.fronts[f].link_begin; l < d_.fronts[f].link_end; ++l) find_bounds(f, d_.links[l]);
    });
  }

  void find_bounds(Index f, const ChildRows& link) {
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

  // The analysis has planned memory for these sizes in this order; of several devices, for each region, unless they
  // turn out not to reach each other's memory. A plan of one device without memory is only listed.
  void take_places() {
    const plan::MemoryPlan& m = plan_.memory;
    if (plan_.ownership.devices == 1) {
      d_.regions[0] = m.size;
      d_.kept = plan_.options.keep_contributions ? m.size : m.factor_size;
      if (!m.factor.empty()) take_places(m);
    } else if (m.device_size.size() == d_.regions.size()) {
      take_places(m);
    } else {
      take_places(plan::plan_regions(plan_, plan::array_sizes(plan_, regions_), pool_.size()));
    }
  }
  void take_places(const plan::MemoryPlan& m) {
    for (std::size_t r = 1; r < d_.regions.size(); ++r) d_.regions[r] = m.device_size[r];
    std::vector<std::vector<std::int32_t>> waits(d_.regions.size());
    for (Index f = 0; f < plan_.fronts(); ++f) {
      Front& x = d_.fronts[f];
      x.factor = m.factor[f];
      x.contribution = m.contribution[f];
      if (!m.factor2.empty()) x.second = m.factor2[f];
      if (!m.contribution2.empty()) x.contribution_up = m.contribution2[f];
      auto& list = waits[at(x.region)];
      x.wait_begin = static_cast<std::int32_t>(list.size());
      list.insert(list.end(), m.wait_fronts.begin() + m.wait_ptr[f], m.wait_fronts.begin() + m.wait_ptr[f + 1]);
      x.wait_end = static_cast<std::int32_t>(list.size());
    }
    join_waits(waits);
  }

  // Region after region.
  void join_waits(const std::vector<std::vector<std::int32_t>>& waits) {
    std::vector<std::int32_t> first;
    for (const auto& list : waits) {
      first.push_back(static_cast<std::int32_t>(d_.waits.size()));
      d_.waits.insert(d_.waits.end(), list.begin(), list.end());
    }
    for (Front& x : d_.fronts) {
      x.wait_begin += first[at(x.region)];
      x.wait_end += first[at(x.region)];
    }
  }

  // The top: factors one after another; tile columns of contributions with their makers. Nothing is used twice, so
  // that nobody waits for a reader on another device.
  void place_top() {
    const auto& a = plan_.ownership;
    d_.place_space.assign(at(a.devices), 0);
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
      const bool apart = x.region == 0 || ((!peer_access_ || mirrored_) && x.readers != 0);
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
  bool peer_access_, mirrored_;
  TaskOrder shape_;
  base::ThreadPool& pool_;
  plan::Regions regions_;
  DevicePlan d_;
};

}  // namespace

plan::PlanOptions cuda_plan_options(Kind kind, const DeviceTuning& tuning, Index devices) {
  plan::PlanOptions o;
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
  o.reuse_distance = tuning.reuse_distance > 0 ? tuning.reuse_distance : (devices == 1 ? 1024 : 4096);
  o.devices = devices;
  o.machine = tuning.machine;
  o.balance_unknowns = tuning.count_balance;
  o.subtrees_apart = false;
  static const CudaArrays arrays;
  o.arrays = &arrays;
  o.narrow_first = true;
  o.additional_subtrees = tuning.additional_subtrees;
  o.column_group = tuning.column_group;
  o.balance_columns = true;
  o.device_speed = tuning.device_speed;
  o.stealing = tuning.stealing;
  o.shared_top = tuning.shared_top;
  return o;
}

DevicePlan make_device_plan(const plan::Plan& plan, Kind kind, bool peer_access, const TaskOrder& shape,
                            base::ThreadPool* pool, bool mirrored) {
  base::ThreadPool alone(1);
  return Builder(plan, kind, peer_access, shape, pool != nullptr ? *pool : alone, mirrored).build();
}

std::vector<double> transferred_elements(const plan::Plan& plan, Kind kind, const DevicePlan& tables) {
  std::vector<double> moved(tables.lists.size(), 0);
  if (moved.size() == 1) return moved;
  const double copies = kind == Kind::llt ? 1 : 2;
  for (Index f = 0; f < plan.fronts(); ++f) {
    const Front& x = tables.fronts[f];
    const auto others = static_cast<unsigned>(x.members);
    if (x.region == 0)
      for (Index j = 0; j < x.pivot_tiles; ++j)
        moved[at(plan.ownership.owner(f, j))] += copies * (std::popcount(others) - 1) *
                                                 (x.column_end(j) - x.column_begin(j)) *
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

// Memory of regions: each is a plan of its own for the planner, with its fronts and its part of the order of tasks.
#include <algorithm>
#include <future>
#include <limits>

#include "base/beside.hpp"
#include "plan/memory_plan.hpp"

namespace espalier::plan {

namespace {

class RegionPlanner {
 public:
  RegionPlanner(const Plan& plan, const ArraySizes& sizes)
      : plan_(plan),
        sizes_(sizes),
        local_(static_cast<std::size_t>(plan.fronts())),
        parts_(static_cast<std::size_t>(sizes.regions)) {
    for (Index f = 0; f < plan.fronts(); ++f) {
      if (sizes.region[f] < 0) continue;
      Region& part = parts_[static_cast<std::size_t>(sizes.region[f])];
      local_[f] = static_cast<Index>(part.fronts.size());
      part.fronts.push_back(f);
      part.first_task = std::min(part.first_task, plan.first_task[f]);
      part.end_task = std::max(part.end_task, plan.last_task[f] + 1);
    }
  }

  MemoryPlan run(int threads) {
    std::vector<std::future<void>> planned;
    for (std::size_t r = 0; r < parts_.size(); ++r)
      planned.push_back(
          base::start_beside([this, r] { plan_part(static_cast<Index>(r)); }, static_cast<int>(r) + 1 < threads));
    for (auto& part : planned) part.wait();
    for (auto& part : planned) part.get();
    return gather();
  }

 private:
  struct Region {
    std::vector<Index> fronts;  // ascending
    Index first_task = std::numeric_limits<Index>::max(), end_task = 0;
    MemoryPlan memory;  // fronts by their numbers in the region
  };

  void plan_part(Index region) {
    Region& part = parts_[static_cast<std::size_t>(region)];
    Plan light;
    ArraySizes sizes;
    take_fronts(region, light, sizes);
    const NumberedTasks tasks = take_tasks(region, light);
    plan_memory(light, sizes, tasks);
    part.memory = std::move(light.memory);
  }

  // What is passed on to other regions is made the contribution to a front that is never eliminated, so that it stays.
  void take_fronts(Index region, Plan& light, ArraySizes& sizes) const {
    const std::vector<Index>& fronts = parts_[static_cast<std::size_t>(region)].fronts;
    const auto n = fronts.size();
    light.options = plan_.options;
    light.options.devices = 1;
    light.tree.parent.assign(n + 1, -1);
    light.layout.resize(n + 1);
    light.whole.assign(n + 1, 1);
    light.child_ptr.assign(n + 2, 0);
    sizes.factor.assign(n + 1, 0);
    sizes.contribution.assign(n + 1, 0);
    for (std::size_t k = 0; k < n; ++k) {
      const Index f = fronts[k], parent = plan_.tree.parent[f];
      if (parent >= 0) light.tree.parent[k] = sizes_.region[parent] == region ? local_[parent] : static_cast<Index>(n);
      light.layout[k] = plan_.layout[f];
      light.whole[k] = plan_.whole[f];
      for (Offset c = plan_.child_ptr[f]; c < plan_.child_ptr[f + 1]; ++c)
        light.children.push_back(local_[plan_.children[c]]);
      light.child_ptr[k + 1] = static_cast<Offset>(light.children.size());
      sizes.factor[k] = sizes_.factor[f];
      sizes.contribution[k] = sizes_.contribution[f];
    }
    light.child_ptr[n + 1] = light.child_ptr[n];
  }

  // The tasks with which the fronts begin and end; a front without any (the one that stays) never begins.
  NumberedTasks take_tasks(Index region, Plan& light) const {
    const Region& part = parts_[static_cast<std::size_t>(region)];
    light.first_task.assign(part.fronts.size() + 1, -1);
    light.last_task.assign(part.fronts.size() + 1, std::numeric_limits<Index>::max());
    NumberedTasks list;
    for (const char late : {0, 1})
      for (Index at = part.first_task; at < part.end_task; ++at) {
        Task task = plan_.tasks[at];
        const Index f = task.front;
        if (sizes_.region[f] != region || sizes_.late[f] != late) continue;
        const bool first = at == plan_.first_task[f], last = at == plan_.last_task[f];
        task.front = local_[f];
        if (task.is_range()) task.begin = task.front;
        if (first) light.first_task[task.front] = list.all;
        if (last) light.last_task[task.front] = list.all;
        if (first || last) {
          list.numbers.push_back(list.all);
          light.tasks.push_back(task);
        }
        ++list.all;
      }
    return list;
  }

  [[nodiscard]] MemoryPlan gather() const {
    const auto n = static_cast<std::size_t>(plan_.fronts());
    MemoryPlan all;
    all.factor.assign(n, 0);
    all.contribution.assign(n, 0);
    if (plan_.options.unsymmetric || plan_.options.ldlt) all.factor2.assign(n, 0);
    if (plan_.options.unsymmetric) all.contribution2.assign(n, 0);
    all.wait_ptr.assign(n + 1, 0);
    for (Index f = 0; f < plan_.fronts(); ++f) {
      all.wait_ptr[f + 1] = static_cast<Offset>(all.wait_fronts.size());
      if (sizes_.region[f] < 0) continue;
      const Region& part = parts_[static_cast<std::size_t>(sizes_.region[f])];
      const MemoryPlan& m = part.memory;
      const Index k = local_[f];
      all.factor[f] = m.factor[k];
      all.contribution[f] = m.contribution[k];
      if (!m.factor2.empty()) all.factor2[f] = m.factor2[k];
      if (!m.contribution2.empty()) all.contribution2[f] = m.contribution2[k];
      for (Offset w = m.wait_ptr[k]; w < m.wait_ptr[k + 1]; ++w)
        all.wait_fronts.push_back(part.fronts[static_cast<std::size_t>(m.wait_fronts[w])]);
      all.wait_ptr[f + 1] = static_cast<Offset>(all.wait_fronts.size());
    }
    for (const Region& part : parts_) {
      all.device_size.push_back(part.memory.size);
      all.size += part.memory.size;
    }
    return all;
  }

  const Plan& plan_;
  const ArraySizes& sizes_;
  std::vector<Index> local_;   // fronts; number in the region
  std::vector<Region> parts_;  // regions
};

}  // namespace

MemoryPlan plan_regions(const Plan& plan, const ArraySizes& sizes, int threads) {
  return RegionPlanner(plan, sizes).run(threads);
}

}  // namespace espalier::plan

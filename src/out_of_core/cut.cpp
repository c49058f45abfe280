#include "out_of_core/cut.hpp"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <utility>

#include "plan/memory_plan.hpp"

namespace espalier::out_of_core {

namespace {

// Bottom-up: every front takes its children's parts along while they fit together; the heaviest are left behind first.
class Cutter {
 public:
  Cutter(const OutOfCoreLayout& layout, const TreeCut& cut)
      : layout_(layout), plan_(layout.plan()), cut_(cut), fronts_(plan_.fronts()) {}

  std::vector<Unit> cut() {
    const auto n = static_cast<std::size_t>(fronts_);
    part_.assign(n, {});
    closed_.assign(n, 0);
    large_.assign(n, 0);
    in_range_.assign(n, 0);
    for (const plan::Task& t : plan_.tasks)
      if (t.is_range())
        for (Index f = t.begin; f < t.front; ++f) in_range_[f] = 1;
    for (Index f = 0; f < fronts_; ++f) take_front(f);
    return gather();
  }

 private:
  struct SubtreeBytes {
    Offset fixed = 0;  // bytes of factors and tables
    Offset live = 0;   // bytes of contributions that exist at one time, tier by tier
    [[nodiscard]] Offset bytes() const { return fixed + live + live / 8; }
  };

  [[nodiscard]] Offset contribution(Index f) const {
    if (plan_.tree.parent[f] < 0) return 0;
    return layout_.sizes().contribution[f] * layout_.element_bytes() * (plan_.options.unsymmetric ? 2 : 1);
  }

  [[nodiscard]] std::vector<Index> devices_of(Index f) const {
    std::vector<Index> list;
    for (std::size_t d = 0; d < cut_.limit_bytes.size(); ++d)
      if ((cut_.sets[f] >> d & 1) != 0) list.push_back(static_cast<Index>(d));
    return list;
  }
  // Who does a step with the front.
  [[nodiscard]] Index device_of(Index f) const {
    const std::vector<Index> devices = devices_of(f);
    return *std::max_element(devices.begin(), devices.end(),
                             [&](Index x, Index y) { return cut_.limit_bytes[x] < cut_.limit_bytes[y]; });
  }
  [[nodiscard]] bool shared(Index f) const { return (cut_.sets[f] & (cut_.sets[f] - 1)) != 0; }
  [[nodiscard]] bool worth_sharing(Index f) const {
    return shared(f) && plan::front_seconds(plan_, f) >= cut_.share_seconds;
  }

  void take_front(Index f) {
    const Offset limit = cut_.limit_bytes[device_of(f)];
    SubtreeBytes own;
    own.fixed = layout_.share_bytes(f) + layout_.sizes().factor[f] * layout_.element_bytes() *
                                             (plan_.options.unsymmetric || plan_.options.ldlt ? 2 : 1);
    Offset together = contribution(f);
    Offset below = 0;
    std::vector<std::pair<Offset, Index>> children;
    for (Offset c = plan_.child_ptr[f]; c < plan_.child_ptr[f + 1]; ++c) {
      const Index child = plan_.children[c];
      together += contribution(child);
      if (cut_.sets[child] != cut_.sets[f]) closed_[child] = 1;
      if (closed_[child] != 0) continue;
      own.fixed += part_[child].fixed;
      below += part_[child].live;
      children.emplace_back(part_[child].bytes(), child);
    }
    std::sort(children.begin(), children.end());
    const auto live = [&] { return in_range_[f] != 0 ? below : std::max(below, together); };
    own.live = live();
    // A range of small fronts is one task: nothing in it is left behind.
    const bool apart = worth_sharing(f);
    while ((apart || own.bytes() > limit) && !children.empty() && in_range_[children.back().second] == 0) {
      const Index child = children.back().second;
      children.pop_back();
      closed_[child] = 1;
      own.fixed -= part_[child].fixed;
      below -= part_[child].live;
      own.live = live();
    }
    part_[f] = own;
    if ((apart || own.bytes() > limit) && plan_.whole[f] == 0) large_[f] = closed_[f] = 1;
    if (plan_.tree.parent[f] < 0) closed_[f] = 1;
  }

  // Steps by rising root; neighbours that do not need each other are put together while they fit.
  [[nodiscard]] std::vector<Unit> gather() const {
    std::vector<Index> root(static_cast<std::size_t>(fronts_));
    for (Index f = fronts_ - 1; f >= 0; --f) root[f] = closed_[f] != 0 ? f : root[plan_.tree.parent[f]];
    std::vector<std::vector<Index>> members(static_cast<std::size_t>(fronts_));
    for (Index f = 0; f < fronts_; ++f) members[root[f]].push_back(f);
    std::vector<Unit> units;
    Unit now;
    Offset bytes = 0;
    std::vector<char> here(static_cast<std::size_t>(fronts_), 0);  // roots of what is in `now`
    const auto flush = [&] {
      for (const Index f : now.fronts) here[f] = 0;
      if (!now.fronts.empty()) {
        std::sort(now.fronts.begin(), now.fronts.end());
        now.devices = {device_of(now.fronts.front())};
        units.push_back(std::move(now));
      }
      now = Unit{};
      bytes = 0;
    };
    for (Index f = 0; f < fronts_; ++f) {
      if (closed_[f] == 0) continue;
      if (large_[f] != 0) {
        flush();
        units.push_back({{}, f, devices_of(f)});
        continue;
      }
      bool needs = false;
      for (const Index g : members[f])
        for (Offset c = plan_.child_ptr[g]; c < plan_.child_ptr[g + 1]; ++c) needs |= here[plan_.children[c]] != 0;
      const bool elsewhere = !now.fronts.empty() && cut_.sets[now.fronts.front()] != cut_.sets[f];
      if (needs || elsewhere || bytes + part_[f].bytes() > cut_.limit_bytes[device_of(f)]) flush();
      now.fronts.insert(now.fronts.end(), members[f].begin(), members[f].end());
      here[f] = 1;
      bytes += part_[f].bytes();
    }
    flush();
    // What devices share comes after all that they do alone: otherwise one waits for another before its own is done.
    std::stable_partition(units.begin(), units.end(),
                          [&](const Unit& u) { return !shared(u.large >= 0 ? u.large : u.fronts.front()); });
    return units;
  }

  const OutOfCoreLayout& layout_;
  const plan::Plan& plan_;
  const TreeCut& cut_;
  Index fronts_;
  std::vector<SubtreeBytes> part_;  // fronts: what is eliminated together with the front
  std::vector<char> closed_;        // fronts; 1: its parent is in another unit
  std::vector<char> large_;
  std::vector<char> in_range_;  // fronts; 1: inside a range task, and not its last front
};

}  // namespace

std::vector<Unit> cut_into_units(const OutOfCoreLayout& layout, const TreeCut& cut) {
  return Cutter(layout, cut).cut();
}

namespace {

// The unit of each front, and its place there; -1: in none.
struct Membership {
  std::vector<std::int32_t> unit, place;
};

// The tasks of a unit that begin or end a front.
struct UnitTasks {
  std::vector<std::size_t> at;  // in OutOfCoreLayout::order()
  plan::NumberedTasks numbered;
};

// What plan_memory() needs of a plan, for the fronts of unit u.
class StepBuilder {
 public:
  StepBuilder(const OutOfCoreLayout& layout, const Unit& unit, std::int32_t u, const Membership& members,
              const UnitTasks& tasks)
      : layout_(layout), plan_(layout.plan()), fronts_(unit.fronts), u_(u), members_(members), tasks_(tasks) {
    s_.fronts = unit.fronts;
  }

  InCoreStep build() {
    light_.options = plan_.options;
    light_.options.devices = 1;
    light_.options.keep_contributions = false;  // what is left for others leaves the step, which is made whole
    add_fronts();
    add_tasks();
    // Small steps shall reuse memory, too; some hundred tasks are under way at one time.
    const Index tasks = tasks_.numbered.all;
    light_.options.reuse_distance = std::min(light_.options.reuse_distance, std::max<Index>(512, tasks / 8));
    plan::plan_memory(light_, sizes_, tasks_.numbered);
    s_.memory = std::move(light_.memory);
    s_.external_at.assign(s_.externals.size(), {-1, -1});
    s_.root_at.assign(fronts_.size(), {-1, -1});
    return std::move(s_);
  }

 private:
  [[nodiscard]] Index place(Index f) const { return members_.unit[f] == u_ ? members_.place[f] : -1; }

  void add_fronts() {
    light_.child_ptr.assign(1, 0);
    for (const Index f : fronts_) {
      light_.tree.parent.push_back(plan_.tree.parent[f] < 0 ? -1 : place(plan_.tree.parent[f]));
      light_.layout.push_back(plan_.layout[f]);
      light_.whole.push_back(plan_.whole[f]);
      sizes_.factor.push_back(layout_.sizes().factor[f]);
      sizes_.contribution.push_back(layout_.sizes().contribution[f]);
      for (Offset c = plan_.child_ptr[f]; c < plan_.child_ptr[f + 1]; ++c) {
        const Index child = plan_.children[c], at = place(child);
        if (at >= 0)
          light_.children.push_back(at);
        else if (plan_.tree.rows_below(child) > 0)
          s_.externals.push_back(child);
      }
      light_.child_ptr.push_back(static_cast<Offset>(light_.children.size()));
      s_.entries += plan_.entry_ptr[plan_.first_tile[f + 1]] - plan_.entry_ptr[plan_.first_tile[f]];
    }
    std::sort(s_.externals.begin(), s_.externals.end());
  }

  void add_tasks() {
    light_.first_task.assign(fronts_.size(), -1);
    light_.last_task.assign(fronts_.size(), -1);
    for (std::size_t k = 0; k < tasks_.at.size(); ++k) {
      const plan::Task& t = layout_.order()[tasks_.at[k]];
      plan::Task local = t;
      local.front = place(t.front);
      local.begin = t.is_range() ? place(t.begin) : -1;
      const Index at = tasks_.numbered.numbers[k];
      for (Index g = t.is_range() ? local.begin : local.front; g <= local.front; ++g) {
        if (light_.first_task[g] < 0) light_.first_task[g] = at;
        light_.last_task[g] = at;
      }
      light_.tasks.push_back(local);
    }
  }

  const OutOfCoreLayout& layout_;
  const plan::Plan& plan_;
  const std::vector<Index>& fronts_;
  std::int32_t u_;
  const Membership& members_;
  const UnitTasks& tasks_;
  InCoreStep s_;
  plan::Plan light_;
  plan::ArraySizes sizes_;
};

}  // namespace

TaskMarks::TaskMarks(const OutOfCoreLayout& layout) : begins_or_ends(layout.order().size(), 0) {
  constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();
  std::vector<std::size_t> last(static_cast<std::size_t>(layout.plan().fronts()), kNone);
  front.reserve(layout.order().size());
  for (const plan::Task& t : layout.order()) {
    std::size_t& its_last = last[static_cast<std::size_t>(t.front)];
    if (its_last == kNone) begins_or_ends[front.size()] = 1;
    its_last = front.size();
    front.push_back(t.front);
  }
  for (const std::size_t task : last)
    if (task != kNone) begins_or_ends[task] = 1;
}

std::vector<InCoreStep> make_in_core_steps(const OutOfCoreLayout& layout, const std::vector<Unit>& units,
                                           const TaskMarks& marks, base::ThreadPool* pool) {
  const auto n = static_cast<std::size_t>(layout.plan().fronts());
  Membership members{std::vector<std::int32_t>(n, -1), std::vector<std::int32_t>(n, -1)};
  for (std::size_t u = 0; u < units.size(); ++u)
    for (std::size_t k = 0; k < units[u].fronts.size(); ++k) {
      members.unit[units[u].fronts[k]] = static_cast<std::int32_t>(u);
      members.place[units[u].fronts[k]] = static_cast<std::int32_t>(k);
    }
  std::vector<UnitTasks> tasks(units.size());
  for (std::size_t k = 0; k < marks.front.size(); ++k) {
    const std::int32_t u = members.unit[marks.front[k]];
    if (u < 0) continue;
    UnitTasks& its = tasks[static_cast<std::size_t>(u)];
    if (marks.begins_or_ends[k] != 0) {
      its.at.push_back(k);
      its.numbered.numbers.push_back(its.numbered.all);
    }
    ++its.numbered.all;
  }
  std::vector<InCoreStep> steps(units.size());
  for_each_unit(units.size(), pool, [&](std::size_t u) {
    if (!units[u].fronts.empty())
      steps[u] = StepBuilder(layout, units[u], static_cast<std::int32_t>(u), members, tasks[u]).build();
  });
  return steps;
}

void give_tasks(const OutOfCoreLayout& layout, std::vector<OutOfCorePlan>& plans) {
  std::vector<InCoreStep*> step_of(static_cast<std::size_t>(layout.plan().fronts()), nullptr);
  for (OutOfCorePlan& p : plans)
    for (InCoreStep& s : p.steps)
      for (const Index f : s.fronts) step_of[f] = &s;
  for (const plan::Task& t : layout.order())
    if (InCoreStep* const s = step_of[t.front]; s != nullptr) s->tasks.push_back(t);
}

}  // namespace espalier::out_of_core

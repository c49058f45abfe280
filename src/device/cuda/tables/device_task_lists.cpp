#include "device/cuda/tables/device_task_lists.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <utility>

#include "device/cuda/tables/tile_tasks.hpp"

namespace espalier::device::cuda {

namespace {

using plan::Plan;
using plan::Task;

constexpr std::int64_t kTasksPerDraw = 1 << 16;  // of the plan's
constexpr std::size_t kColumnsPerRange = 256;    // tasks of the plan from which lists of tasks follow

class TaskLister {
 public:
  TaskLister(const Plan& plan, Kind kind, const std::vector<char>& narrow, const TaskOrder& order,
             base::ThreadPool& pool, DevicePlan& d)
      : plan_(plan), narrow_(narrow), tile_tasks_(kind, order), pool_(pool), d_(d) {}

  // Ranges of the order side by side: first it is counted what each lists, beside what a solve does, then each writes
  // its tasks to their places.
  void list() {
    find_columns();
    cut_ranges();
    pool_.for_each(1 + static_cast<std::int64_t>(ranges_.size()), [&](std::int64_t k) {
      if (k == 0) return list_solve_tasks();
      count(ranges_[static_cast<std::size_t>(k - 1)]);
    });
    take_places();
    pool_.for_each(static_cast<std::int64_t>(ranges_.size()),
                   [&](std::int64_t k) { write(ranges_[static_cast<std::size_t>(k)]); });
  }

 private:
  // What a task of the plan begins: a front that is taken whole (column -1), or all tasks of some tile columns.
  struct Column {
    Index front, column;
  };
  // Where a unit's tasks of one phase begin in a list.
  struct Place {
    TaskLists* list;
    std::int64_t at;
  };
  // A task goes to a *unit*: a device's part of the top, or a region from 1 on.
  struct ColumnRange {
    std::size_t begin, end;  // of columns_
    int phase;
    std::vector<std::int64_t> tasks;  // units: how many, then how many stand before them in the phase
  };

  // The order of the plan's tasks, those of narrow fronts first; tasks below the diagonal follow from those on it.
  void find_columns() {
    const auto all = static_cast<std::int64_t>(plan_.tasks.size());
    const auto draws = static_cast<std::size_t>((all + kTasksPerDraw - 1) / kTasksPerDraw);
    std::vector<std::array<std::size_t, 2>> place(draws, {0, 0});  // by phase: how many, then where they begin
    const auto visit = [&](std::int64_t draw, auto&& use) {
      for (auto at = draw * kTasksPerDraw; at < std::min(all, (draw + 1) * kTasksPerDraw); ++at)
        if (const Task& task = plan_.tasks[static_cast<std::size_t>(at)]; task.is_range() || task.i == task.j)
          use(task, narrow_[task.front] != 0 ? 0 : 1);
    };
    pool_.for_each(static_cast<std::int64_t>(draws), [&](std::int64_t draw) {
      visit(draw, [&](const Task&, int phase) { ++place[static_cast<std::size_t>(draw)][phase]; });
    });
    std::size_t next = 0;
    for (const int phase : {0, 1}) {
      for (auto& of_draw : place) next += std::exchange(of_draw[phase], next);
      if (phase == 0) narrow_columns_ = next;
    }
    columns_.resize(next);
    pool_.for_each(static_cast<std::int64_t>(draws), [&](std::int64_t draw) {
      auto& to = place[static_cast<std::size_t>(draw)];
      visit(draw, [&](const Task& task, int phase) {
        columns_[to[phase]++] = {task.front, task.is_range() ? -1 : task.j};
      });
    });
  }

  void cut_ranges() {
    const auto cut = [&](std::size_t begin, std::size_t end, int phase) {
      for (; begin < end; begin = ranges_.back().end)
        ranges_.push_back({begin, std::min(end, begin + kColumnsPerRange), phase, {}});
    };
    cut(0, narrow_columns_, 0);
    cut(narrow_columns_, columns_.size(), 1);
  }

  [[nodiscard]] std::size_t units() const { return d_.lists.size() + d_.regions.size() - 1; }
  [[nodiscard]] std::size_t unit_of(const FactorTask& task) const {
    if (task.region != 0) return d_.lists.size() + task.region - 1;
    return static_cast<std::size_t>(plan_.ownership.owner(task.front, task.column));
  }

  void count(ColumnRange& range) {
    range.tasks.assign(units(), 0);
    for (std::size_t c = range.begin; c < range.end; ++c) {
      std::int32_t tasks = 0;
      list_column(columns_[c], [&](const FactorTask& task) {
        ++range.tasks[unit_of(task)];
        ++tasks;
      });
      // Other ranges may have tasks of the front, too.
      std::atomic_ref(d_.fronts[columns_[c].front].tasks).fetch_add(tasks, std::memory_order_relaxed);
    }
  }

  // Each list in two phases: its own region, what may be stolen, beginning with its own, its part of the top.
  void take_places() {
    std::vector<std::int64_t> all[2];
    for (auto& of_phase : all) of_phase.assign(units(), 0);
    for (ColumnRange& range : ranges_)
      for (std::size_t unit = 0; unit < units(); ++unit)
        all[range.phase][unit] += std::exchange(range.tasks[unit], all[range.phase][unit]);
    for (auto& of_phase : places_) of_phase.resize(units());
    const std::size_t devices = d_.lists.size();
    for (std::size_t d = 0; d < devices; ++d) {
      TaskLists& l = d_.lists[d];
      l.stealable_end.assign(d_.regions.size() - static_cast<std::size_t>(d_.first_stealable), 0);
      std::int64_t end = 0;
      for (const int phase : {0, 1}) {
        const auto add = [&](std::size_t unit) {
          places_[phase][unit].push_back({&l, end});
          end += all[phase][unit];
          return all[phase][unit] > 0;
        };
        if (devices > 1) add(devices + d);
        for (std::size_t turn = 0; turn < devices; ++turn)
          for (auto r = static_cast<std::size_t>(d_.first_stealable); r < d_.regions.size(); ++r)
            if (static_cast<std::size_t>(d_.region_device[r]) == (d + turn) % devices && add(devices + r - 1))
              l.stealable_end[r - static_cast<std::size_t>(d_.first_stealable)] = static_cast<std::int32_t>(end);
        add(d);
        if (phase == 0) l.narrow_tasks = end;
      }
      l.tasks.resize(static_cast<std::size_t>(end));
    }
  }

  // To the first list that has the unit; from there to the others.
  void write(const ColumnRange& range) {
    const auto& places = places_[range.phase];
    const auto place = [&](std::size_t unit, const Place& p) {
      return p.list->tasks.data() + p.at + range.tasks[unit];
    };
    std::vector<FactorTask*> to;
    for (std::size_t unit = 0; unit < units(); ++unit) to.push_back(place(unit, places[unit].front()));
    for (std::size_t c = range.begin; c < range.end; ++c)
      list_column(columns_[c], [&](const FactorTask& task) { *to[unit_of(task)]++ = task; });
    for (std::size_t unit = 0; unit < units(); ++unit)
      for (std::size_t k = 1; k < places[unit].size(); ++k)
        std::copy(place(unit, places[unit].front()), to[unit], place(unit, places[unit][k]));
  }

  // Up: children before parents, tier by tier from the deepest; down: the reverse. Sub-trees in which every front is
  // small are taken first on the way up and last on the way down. All members of a front do all of it.
  void list_solve_tasks() {
    std::vector<char> small(static_cast<std::size_t>(plan_.fronts()), 1);
    std::vector<Index> order(small.size());
    for (Index f = 0; f < plan_.fronts(); ++f) {
      const Front& x = d_.fronts[f];
      if (x.total_pad > kSmallRows || x.pivot_pad > kWideTiles) small[f] = 0;
      const Index p = plan_.tree.parent[f];
      if (p >= 0 && small[f] == 0) small[p] = 0;
      order[f] = f;
    }
    std::stable_sort(order.begin(), order.end(), [&](Index a, Index b) {
      return small[a] != small[b] ? small[a] > small[b] : plan_.tier[a] > plan_.tier[b];
    });
    const auto for_members = [&](Index f, auto&& use) {
      for (std::size_t d = 0; d < d_.lists.size(); ++d)
        if ((std::uint64_t{d_.fronts[f].members} >> d & 1) != 0) use(d_.lists[d]);  // the simulator has up to 64 lists
    };
    for (const Index f : order)
      for_members(f, [&](TaskLists& l) {
        const bool single = small[f] != 0 || d_.fronts[f].total_pad <= kRowBlock;
        for (Index a = 0; a < (single ? 1 : d_.fronts[f].blocks); ++a) l.up.push_back({f, single ? -1 : a});
        l.small_up += small[f];
      });
    for (auto it = order.rbegin(); it != order.rend(); ++it)
      for_members(*it, [&](TaskLists& l) {
        for (Index a = d_.fronts[*it].pivot_blocks; a-- > 0;) l.down.push_back({*it, a});
        l.small_down += small[*it];
      });
  }

  template <class Use>
  void list_column(const Column& c, Use&& use) const {
    const Front& x = d_.fronts[c.front];
    const auto one = [&](Work work, int part, Index block, Index column) {
      use(FactorTask{c.front, work, static_cast<std::int8_t>(part), static_cast<std::uint16_t>(x.region), block,
                     column});
    };
    const auto task = [&](Work work, int part, Index block, Index column) {
      const auto owner = [&](Index j) { return plan_.ownership.owner(c.front, j); };
      if (work != Work::two_columns || owner(column) == owner(column + 1)) return one(work, part, block, column);
      for (const Index j : {column, column + 1}) one(Work::block, part, block, j);
    };
    if (c.column < 0)
      task(Work::whole, 0, 0, 0);
    else
      tile_tasks_.column(x, c.column, task);
  }

  const Plan& plan_;
  const std::vector<char>& narrow_;
  TileTasks tile_tasks_;
  base::ThreadPool& pool_;
  DevicePlan& d_;
  std::vector<Column> columns_;  // in the order of the plan, those of narrow fronts first
  std::size_t narrow_columns_ = 0;
  std::vector<ColumnRange> ranges_;            // of columns_
  std::vector<std::vector<Place>> places_[2];  // phases: units: in which lists they are
};

}  // namespace

void list_tasks(const Plan& plan, Kind kind, const std::vector<char>& narrow, const TaskOrder& order,
                base::ThreadPool& pool, DevicePlan& d) {
  TaskLister(plan, kind, narrow, order, pool, d).list();
}

}  // namespace espalier::device::cuda

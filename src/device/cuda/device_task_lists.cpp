#include "device/cuda/device_task_lists.hpp"

#include <algorithm>

namespace espalier::device::cuda {

namespace {

using analysis::Plan;
using analysis::Task;

class TaskLister {
 public:
  TaskLister(const Plan& plan, Kind kind, const std::vector<char>& narrow, const TaskOrder& shape, DevicePlan& d)
      : plan_(plan), kind_(kind), narrow_(narrow), shape_(shape), d_(d) {}

  // Tasks by what they belong to: each device's part of the top, then the regions from 1 on; first those of the narrow
  // kernel, then the others.
  void list_tasks(const std::vector<Task>& order) {
    const auto narrow_end =
        std::find_if(order.begin(), order.end(), [&](const Task& task) { return narrow_[task.front] == 0; });
    for (TaskLists& l : d_.lists)
      l.stealable_end.assign(d_.regions.size() - static_cast<std::size_t>(d_.first_stealable), 0);
    list_phase(order.begin(), narrow_end);
    for (TaskLists& l : d_.lists) l.narrow_tasks = static_cast<std::int64_t>(l.tasks.size());
    list_phase(narrow_end, order.end());
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

 private:
  [[nodiscard]] bool is_lu() const { return kind_ == Kind::lu; }

  void emit(Index f, Work work, int part, Index block, Index column) {
    Front& x = d_.fronts[f];
    const auto unit =
        x.region == 0 ? plan_.assignment.owner(f, column) : static_cast<Index>(d_.lists.size()) + x.region - 1;
    units_[static_cast<std::size_t>(unit)].push_back(
        {f, work, static_cast<std::int8_t>(part), static_cast<std::uint16_t>(x.region), block, column});
    ++x.tasks;
  }

  void emit_block(Index f, Index block, Index column) {
    emit(f, Work::block, 0, block, column);
    if (is_lu()) emit(f, Work::block, 1, block, column);
  }

  // The tasks that begin with tile column j; columns that go with an earlier one have none of their own.
  void emit_column(Index f, Index j) {
    const Front& x = d_.fronts[f];
    const Index paired = shape_.pair_from;
    if (j >= x.pivot_tiles) {
      if ((j - x.pivot_tiles) % shape_.group_columns == 0)
        emit_contribution(f, j, std::min(j + shape_.group_columns, x.tiles));
    } else if (x.width != kWideTiles || j < paired) {
      emit_pivots(f, j, j + 1);
    } else if ((j - paired) % 2 == 0) {
      emit_pivots(f, j, std::min(j + 2, x.pivot_tiles));
    }
  }

  // Columns [begin, end) of the contribution, in rectangles of the rows.
  void emit_contribution(Index f, Index begin, Index end) {
    const Front& x = d_.fronts[f];
    for (Index first = x.block_of_column(begin); first < x.blocks; first += shape_.group_blocks)
      for (Index j = begin; j < end; ++j)
        for (Index a = first; a < std::min(first + shape_.group_blocks, x.blocks); ++a)
          if (x.block_end(a) > x.column_begin(j)) emit_block(f, a, j);
  }

  // Pivot columns [begin, end), row block by row block. The next diagonal tile follows as soon as what it needs has
  // been listed, so that it is ready when the next column begins.
  void emit_pivots(Index f, Index begin, Index end) {
    const Front& x = d_.fronts[f];
    if (begin == 0) emit(f, Work::diagonal, 0, 0, 0);
    Index next = begin + 1;  // diagonal tile
    for (Index a = x.block_of_column(begin); a < x.blocks; ++a)
      for (Index j = begin; j < end; ++j) {
        if (x.block_end(a) > x.column_end(j)) emit_block(f, a, j);
        // Diagonal tile j + 1 needs its row block in columns up to j.
        if (next != j + 1 || next == x.pivot_tiles || a < x.block_of_column(next)) continue;
        emit(f, Work::diagonal, 0, 0, next);
        ++next;
      }
  }

  template <class It>
  void list_phase(It begin, It end) {
    const std::size_t devices = d_.lists.size();
    units_.assign(devices + d_.regions.size() - 1, {});
    for (auto task = begin; task != end; ++task) {
      if (task->is_range())
        emit(task->front, Work::whole, 0, 0, 0);
      else if (task->i == task->j)
        emit_column(task->front, task->j);
    }
    for (std::size_t d = 0; d < devices; ++d) {
      TaskLists& l = d_.lists[d];
      const auto add = [&](std::size_t unit) {
        l.tasks.insert(l.tasks.end(), units_[unit].begin(), units_[unit].end());
      };
      if (devices > 1) add(devices + d);
      for (std::size_t turn = 0; turn < devices; ++turn)
        for (std::size_t r = static_cast<std::size_t>(d_.first_stealable); r < d_.regions.size(); ++r) {
          if (static_cast<std::size_t>(d_.region_device[r]) != (d + turn) % devices || units_[devices + r - 1].empty())
            continue;
          add(devices + r - 1);
          l.stealable_end[r - static_cast<std::size_t>(d_.first_stealable)] = static_cast<std::int32_t>(l.tasks.size());
        }
      add(d);
    }
  }

  const Plan& plan_;
  Kind kind_;
  const std::vector<char>& narrow_;
  TaskOrder shape_;
  DevicePlan& d_;
  std::vector<std::vector<FactorTask>> units_;  // see list_tasks()
};

}  // namespace

void list_tasks(const Plan& plan, Kind kind, const std::vector<Task>& order, const std::vector<char>& narrow,
                const TaskOrder& shape, DevicePlan& d) {
  TaskLister lister(plan, kind, narrow, shape, d);
  lister.list_tasks(order);
  lister.list_solve_tasks();
}

}  // namespace espalier::device::cuda

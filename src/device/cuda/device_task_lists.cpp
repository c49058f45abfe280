#include "device/cuda/device_task_lists.hpp"

#include <algorithm>
#include <atomic>
#include <utility>

namespace espalier::device::cuda {

namespace {

using analysis::Plan;
using analysis::Task;

constexpr std::ptrdiff_t kTasksPerPiece = 1 << 14;  // of the plan's

class TaskLister {
 public:
  TaskLister(const Plan& plan, Kind kind, const std::vector<char>& narrow, const TaskOrder& shape, DevicePlan& d)
      : plan_(plan), kind_(kind), narrow_(narrow), shape_(shape), d_(d) {}

  // Pieces of the order side by side, and beside them what a solve does.
  void list(const std::vector<Task>& order, base::ThreadPool& pool) {
    const auto narrow_end =
        std::partition_point(order.begin(), order.end(), [&](const Task& task) { return narrow_[task.front] != 0; });
    std::vector<Piece> phases[2];
    cut(order.begin(), narrow_end, phases[0]);
    cut(narrow_end, order.end(), phases[1]);
    const auto narrow_pieces = static_cast<std::int64_t>(phases[0].size());
    pool.for_each(1 + narrow_pieces + static_cast<std::int64_t>(phases[1].size()), [&](std::int64_t k) {
      if (k == 0) return list_solve_tasks();
      list_piece(k <= narrow_pieces ? phases[0][k - 1] : phases[1][k - 1 - narrow_pieces]);
    });
    for (TaskLists& l : d_.lists)
      l.stealable_end.assign(d_.regions.size() - static_cast<std::size_t>(d_.first_stealable), 0);
    join(phases[0]);
    for (TaskLists& l : d_.lists) l.narrow_tasks = static_cast<std::int64_t>(l.tasks.size());
    join(phases[1]);
  }

 private:
  // A part of the plan's order, and its tasks by what they belong to: each device's part of the top, then the regions
  // from 1 on.
  struct Piece {
    std::vector<Task>::const_iterator begin, end;
    std::vector<std::vector<FactorTask>> units;
  };

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

  [[nodiscard]] bool is_lu() const { return kind_ == Kind::lu; }

  void emit(Piece& out, Index f, Work work, int part, Index block, Index column) {
    Front& x = d_.fronts[f];  // other pieces may have tasks of it, too
    const auto unit =
        x.region == 0 ? plan_.assignment.owner(f, column) : static_cast<Index>(d_.lists.size()) + x.region - 1;
    out.units[static_cast<std::size_t>(unit)].push_back(
        {f, work, static_cast<std::int8_t>(part), static_cast<std::uint16_t>(x.region), block, column});
    std::atomic_ref(x.tasks).fetch_add(1, std::memory_order_relaxed);
  }

  void emit_block(Piece& out, Index f, Index block, Index column) {
    emit(out, f, Work::block, 0, block, column);
    if (is_lu()) emit(out, f, Work::block, 1, block, column);
  }

  // The tasks that begin with tile column j; columns that go with an earlier one have none of their own.
  void emit_column(Piece& out, Index f, Index j) {
    const Front& x = d_.fronts[f];
    const Index paired = shape_.pair_from;
    if (j >= x.pivot_tiles) {
      if ((j - x.pivot_tiles) % shape_.group_columns == 0)
        emit_contribution(out, f, j, std::min(j + shape_.group_columns, x.tiles));
    } else if (x.width != kWideTiles || j < paired) {
      emit_pivots(out, f, j, j + 1);
    } else if ((j - paired) % 2 == 0) {
      emit_pivots(out, f, j, std::min(j + 2, x.pivot_tiles));
    }
  }

  // Columns [begin, end) of the contribution, in rectangles of the rows.
  void emit_contribution(Piece& out, Index f, Index begin, Index end) {
    const Front& x = d_.fronts[f];
    for (Index first = x.block_of_column(begin); first < x.blocks; first += shape_.group_blocks)
      for (Index j = begin; j < end; ++j)
        for (Index a = first; a < std::min(first + shape_.group_blocks, x.blocks); ++a)
          if (x.block_end(a) > x.column_begin(j)) emit_block(out, f, a, j);
  }

  // Pivot columns [begin, end), row block by row block. The next diagonal tile follows as soon as what it needs has
  // been listed, so that it is ready when the next column begins.
  void emit_pivots(Piece& out, Index f, Index begin, Index end) {
    const Front& x = d_.fronts[f];
    if (begin == 0) emit(out, f, Work::diagonal, 0, 0, 0);
    Index next = begin + 1;  // diagonal tile
    for (Index a = x.block_of_column(begin); a < x.blocks; ++a)
      for (Index j = begin; j < end; ++j) {
        if (x.block_end(a) > x.column_end(j)) emit_block(out, f, a, j);
        // Diagonal tile j + 1 needs its row block in columns up to j.
        if (next != j + 1 || next == x.pivot_tiles || a < x.block_of_column(next)) continue;
        emit(out, f, Work::diagonal, 0, 0, next);
        ++next;
      }
  }

  static void cut(std::vector<Task>::const_iterator begin, std::vector<Task>::const_iterator end,
                  std::vector<Piece>& pieces) {
    for (; begin != end; begin = pieces.back().end)
      pieces.push_back({begin, begin + std::min(kTasksPerPiece, end - begin), {}});
  }

  void list_piece(Piece& piece) {
    piece.units.resize(d_.lists.size() + d_.regions.size() - 1);
    for (auto task = piece.begin; task != piece.end; ++task) {
      if (task->is_range())
        emit(piece, task->front, Work::whole, 0, 0, 0);
      else if (task->i == task->j)
        emit_column(piece, task->front, task->j);
    }
  }

  // Appends the tasks of one phase to the lists of the devices.
  void join(const std::vector<Piece>& pieces) {
    const std::size_t devices = d_.lists.size();
    const auto add = [&](TaskLists& l, std::size_t unit) {
      const std::size_t before = l.tasks.size();
      std::size_t more = 0;
      for (const Piece& p : pieces) more += p.units[unit].size();
      l.tasks.reserve(before + more);
      for (const Piece& p : pieces) l.tasks.insert(l.tasks.end(), p.units[unit].begin(), p.units[unit].end());
      return more > 0;
    };
    for (std::size_t d = 0; d < devices; ++d) {
      TaskLists& l = d_.lists[d];
      if (devices > 1) add(l, devices + d);
      for (std::size_t turn = 0; turn < devices; ++turn)
        for (std::size_t r = static_cast<std::size_t>(d_.first_stealable); r < d_.regions.size(); ++r) {
          if (static_cast<std::size_t>(d_.region_device[r]) != (d + turn) % devices) continue;
          if (add(l, devices + r - 1))
            l.stealable_end[r - static_cast<std::size_t>(d_.first_stealable)] =
                static_cast<std::int32_t>(l.tasks.size());
        }
      add(l, d);
    }
  }

  const Plan& plan_;
  Kind kind_;
  const std::vector<char>& narrow_;
  TaskOrder shape_;
  DevicePlan& d_;
};

}  // namespace

void list_tasks(const Plan& plan, Kind kind, const std::vector<Task>& order, const std::vector<char>& narrow,
                const TaskOrder& shape, base::ThreadPool& pool, DevicePlan& d) {
  TaskLister(plan, kind, narrow, shape, d).list(order, pool);
}

}  // namespace espalier::device::cuda

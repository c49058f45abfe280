#include "plan/changed_plan.hpp"

#include <algorithm>
#include <utility>

#include "plan/entry_places.hpp"
#include "plan/layout_steps.hpp"

namespace espalier::plan {

namespace {

// A quarter of the arena, half a gigabyte of doubles at most: where moved pivots need more, most fronts have changed.
// Two megabytes are little for any.
Offset room(Offset size) {
  constexpr Offset kLeast = 1 << 18, kMost = 1 << 26;
  return std::clamp(size / 4, kLeast, kMost);
}

class PlanChange {
 public:
  PlanChange(const Plan& before, std::vector<Index> front_before)
      : old_(before), front_before_(std::move(front_before)), name_(static_cast<std::size_t>(before.fronts()), -1) {
    for (std::size_t f = 0; f < front_before_.size(); ++f) name_[front_before_[f]] = static_cast<Index>(f);
  }

  // False: the plan has to be made anew.
  bool run(analysis::AssemblyTree tree, const EntrySource& from, base::ThreadPool& pool) {
    if (old_.options.devices != 1 || old_.options.arrays != nullptr) return false;
    plan_.tree = std::move(tree);
    plan_.options = old_.options;
    plan_.ownership = old_.ownership;
    link_children(plan_);
    cut_fronts(plan_);
    find_same();
    if (!list_tasks()) return false;
    place_memory();
    if (plan_.memory.added > room(plan_.memory.size - plan_.memory.added)) return false;
    name_waits();
    relate_rows(plan_, pool);
    place_entries_as_before(plan_, old_, same_, from, pool);
    return true;
  }

  ChangedPlan take() { return {std::move(plan_), {std::move(front_before_), std::move(same_)}}; }

 private:
  [[nodiscard]] Offset round(Offset x) const {
    const Offset p = plan_.options.tiles.panel;
    return (x + p - 1) / p * p;
  }

  // A front whose parent vanished counts as changed: its contribution lives longer than it did.
  void find_same() {
    const analysis::AssemblyTree &t = plan_.tree, &was = old_.tree;
    std::vector<Index> place(static_cast<std::size_t>(t.n));  // by column
    for (Index k = 0; k < t.n; ++k) place[t.order[k]] = k;
    same_ = front_before_;
    for (Index f = 0; f < t.fronts(); ++f) {
      const Index o = front_before_[f];
      bool same = t.pivots(f) == was.pivots(o) && t.rows_below(f) == was.rows_below(o) &&
                  (was.parent[o] < 0 || name_[was.parent[o]] >= 0);
      for (Index k = 0; same && k < t.pivots(f); ++k) same = t.order[t.first[f] + k] == was.order[was.first[o] + k];
      for (Index r = 0; same && r < t.rows_below(f); ++r)
        same = t.rows[t.row_ptr[f] + r] == place[was.order[was.rows[was.row_ptr[o] + r]]];
      if (!same) same_[f] = -1;
    }
  }

  void push(const Task& task) {
    const auto at = static_cast<Index>(plan_.tasks.size());
    for (Index f = task.is_range() ? task.begin : task.front; f <= task.front; ++f) {
      if (plan_.first_task[f] < 0) plan_.first_task[f] = at;
      plan_.last_task[f] = at;
    }
    plan_.tasks.push_back(task);
  }

  // All tasks of a changed front stand where its last one stood: behind those of its children, before its parent's, and
  // before those of fronts that take over its memory.
  void push_changed(Index f) {
    if (plan_.whole[f] != 0) return push({f, f, 0, 0});
    const FrontLayout& l = plan_.layout[f];
    for (Index j = 0; j < l.tiles; ++j)
      for (Index i = j; i < l.tiles; ++i) push({f, -1, i, j});
  }

  bool push_range(const Task& task) {
    Index begin = -1, end = -1;
    for (Index o = task.begin; o <= task.front; ++o) {
      const Index f = name_[o];
      if (f < 0) continue;
      if (plan_.whole[f] == 0) {
        if (task.begin < task.front) return false;
        push_changed(f);
        return true;
      }
      if (begin < 0) begin = f;
      end = f;
    }
    if (end >= 0) push({end, begin, 0, 0});
    return true;
  }

  bool list_tasks() {
    plan_.first_task.assign(static_cast<std::size_t>(plan_.fronts()), -1);
    plan_.last_task.assign(static_cast<std::size_t>(plan_.fronts()), -1);
    for (std::size_t t = 0; t < old_.tasks.size(); ++t) {
      const Task& task = old_.tasks[t];
      if (task.is_range()) {
        if (!push_range(task)) return false;
        continue;
      }
      const Index f = name_[task.front];
      if (f < 0) continue;
      if (same_[f] >= 0)
        push({f, -1, task.i, task.j});
      else if (static_cast<Index>(t) == old_.last_task[task.front])
        push_changed(f);
    }
    return true;
  }

  Offset add(Offset size) {
    MemoryPlan& m = plan_.memory;
    const Offset at = m.size;
    m.size += size;
    m.added += size;
    return at;
  }

  void place_memory() {
    const MemoryPlan& was = old_.memory;
    MemoryPlan& m = plan_.memory;
    const bool lu = plan_.options.unsymmetric;
    m.size = was.size;
    m.added = was.added;
    m.factor_size = was.factor_size;
    m.stack_size = was.stack_size;
    const auto take_over = [&](const auto& from, auto& to) {
      if (from.empty()) return;
      to.resize(front_before_.size());
      for (std::size_t f = 0; f < front_before_.size(); ++f) to[f] = from[front_before_[f]];
    };
    take_over(was.factor, m.factor);
    take_over(was.factor2, m.factor2);
    take_over(was.contribution, m.contribution);
    take_over(was.contribution2, m.contribution2);
    take_over(was.on_stack, m.on_stack);
    for (Index f = 0; f < plan_.fronts(); ++f)
      if (same_[f] < 0) place_changed(f, lu);
    m.device_size.assign(1, m.size);
  }

  void place_changed(Index f, bool lu) {
    MemoryPlan& m = plan_.memory;
    const FrontLayout& l = plan_.layout[f];
    const Index o = front_before_[f], up = old_.tree.parent[o];
    const FrontLayout& was = old_.layout[o];
    const Offset factor = round(l.factor_size()), left = round(l.contribution_size());
    const bool grows = factor > round(was.factor_size());
    if (grows) {
      m.factor[f] = add(factor);
      m.factor_size += factor * (lu ? 2 : 1);
      if (lu) m.factor2[f] = add(factor);
    }
    if (plan_.options.ldlt && plan_.whole[f] == 0 && (grows || old_.whole[o] != 0)) m.factor2[f] = add(factor);
    const bool had_place = m.on_stack[f] == 0 && up >= 0 && name_[up] >= 0;
    m.on_stack[f] = 0;
    if (plan_.tree.parent[f] < 0 || left == 0 || (had_place && left <= round(was.contribution_size()))) return;
    m.contribution[f] = add(left);
    if (lu) m.contribution2[f] = add(left);
  }

  // Fronts whose end means that of front o before: a front that has vanished ends with its children and with those for
  // which it waited.
  void stand_for(Index o, std::vector<Index>& list) const {
    if (name_[o] >= 0) return list.push_back(name_[o]);
    for (Offset c = old_.child_ptr[o]; c < old_.child_ptr[o + 1]; ++c) stand_for(old_.children[c], list);
    add_waits(o, list);
  }
  void add_waits(Index o, std::vector<Index>& list) const {
    for (Offset q = old_.memory.wait_ptr[o]; q < old_.memory.wait_ptr[o + 1]; ++q)
      stand_for(old_.memory.wait_fronts[q], list);
  }

  // The waits of a range stand with its last front.
  void name_waits() {
    std::vector<std::vector<Index>> waits(front_before_.size());
    for (const Task& task : old_.tasks) {
      if (!task.is_range() && old_.first_task[task.front] != &task - old_.tasks.data()) continue;
      Index heir = task.front;
      if (task.is_range())
        while (heir > task.begin && name_[heir] < 0) --heir;
      while (heir >= 0 && name_[heir] < 0) heir = old_.tree.parent[heir];
      if (heir >= 0) add_waits(task.front, waits[name_[heir]]);
    }
    // An heir inside a range hands its waits on to the range.
    for (const Task& task : plan_.tasks)
      for (Index f = task.begin; task.is_range() && f < task.front; ++f) {
        waits[task.front].insert(waits[task.front].end(), waits[f].begin(), waits[f].end());
        waits[f].clear();
      }
    MemoryPlan& m = plan_.memory;
    m.wait_ptr.assign(front_before_.size() + 1, 0);
    for (std::size_t f = 0; f < waits.size(); ++f) {
      std::sort(waits[f].begin(), waits[f].end());
      waits[f].erase(std::unique(waits[f].begin(), waits[f].end()), waits[f].end());
      m.wait_fronts.insert(m.wait_fronts.end(), waits[f].begin(), waits[f].end());
      m.wait_ptr[f + 1] = static_cast<Offset>(m.wait_fronts.size());
    }
  }

  const Plan& old_;
  std::vector<Index> front_before_;
  std::vector<Index> name_;  // by front before: its number now, -1: it has vanished
  Plan plan_;
  std::vector<Index> same_;
};

}  // namespace

Offset elements_with_room(const MemoryPlan& m) { return std::max(m.size, m.size - m.added + room(m.size - m.added)); }

std::optional<ChangedPlan> change_plan(const Plan& before, analysis::AssemblyTree tree, std::vector<Index> front_before,
                                       const MatrixView& a, const std::vector<Index>& row_of_col,
                                       const matrix::RowIndex& rows, base::ThreadPool& pool) {
  PlanChange change(before, std::move(front_before));
  if (!change.run(std::move(tree), {a, rows, row_of_col}, pool)) return std::nullopt;
  return change.take();
}

}  // namespace espalier::plan

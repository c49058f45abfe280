#include "plan/task_list.hpp"

#include <algorithm>
#include <span>
#include <vector>

#include "base/parallel.hpp"
#include "plan/rank_parts.hpp"
#include "plan/regions.hpp"

namespace espalier::plan {

namespace {

// Two passes: one over fronts says which of them are taken together and where their tasks begin in the list; these are
// written by all threads then.
class TaskLister {
 public:
  explicit TaskLister(Plan& plan) : plan_(plan), fronts_(plan.fronts()) {}

  void list(base::ThreadPool* pool) {
    measure_subtrees();
    plan_.first_task.assign(static_cast<std::size_t>(fronts_), 0);
    plan_.last_task.assign(static_cast<std::size_t>(fronts_), 0);
    walk();
    write(pool);
  }

 private:
  // Fronts whose tasks stand together: a range, or some that advance together.
  struct Group {
    Index begin, end;  // of grouped_
    Index range;       // first front of a range, whose last one is the only one of the group; -1: tiles
    Index at;          // place of the first task: in the list, or among what is late
    bool late;
  };

  void walk() {
    if (plan_.ownership.devices > 1) return list_for_devices();
    // Trees of a forest that fit into one group together are taken together.
    std::vector<Index> roots;
    for (Index f = 0; f < fronts_; ++f)
      if (plan_.tree.parent[f] < 0) roots.push_back(f);
    if (plan_.options.narrow_first) late_front_ = wide_fronts(plan_);
    walk_children(roots);
  }

  void write(base::ThreadPool* pool) {
    constexpr std::int64_t kGroups = 16;  // per range
    plan_.tasks.clear();
    plan_.tasks.resize(static_cast<std::size_t>(listed_ + late_));
    base::for_each_range(pool, static_cast<std::int64_t>(groups_.size()), kGroups,
                         [&](std::int64_t begin, std::int64_t end) {
                           for (std::int64_t g = begin; g < end; ++g) write(groups_[static_cast<std::size_t>(g)]);
                         });
  }

  void list_for_devices() {
    Ownership& a = plan_.ownership;
    for (auto s = a.subtrees.begin(); s != a.subtrees.end();) {
      auto end = s;
      while (end != a.subtrees.end() && end->device == s->device) ++end;
      std::vector<SubTree*> together;
      for (auto t = s; t != end; ++t)
        if (!t->apart) together.push_back(&*t);
      if (!together.empty()) walk_together(together);
      for (auto t = s; t != end; ++t)
        if (t->apart) walk_together({&*t});
      s = end;
    }
    a.top_task = listed_;
    std::vector<std::vector<Index>> tiers;
    for (Index f = 0; f < fronts_; ++f) {
      if (a.subtree(f) >= 0) continue;
      tiers.resize(std::max(tiers.size(), static_cast<std::size_t>(plan_.tier[f]) + 1));
      tiers[plan_.tier[f]].push_back(f);
    }
    for (auto t = tiers.rbegin(); t != tiers.rend(); ++t) emit_tier(*t);
  }

  [[nodiscard]] bool is_late(Index f) const { return !late_front_.empty() && late_front_[f] != 0; }

  void walk_together(const std::vector<SubTree*>& subtrees) {
    std::vector<Index> roots;
    const bool elsewhere = plan_.options.ranks > 1 && subtrees.front()->device != plan_.options.rank;
    for (const SubTree* s : subtrees)
      if (!elsewhere) roots.insert(roots.end(), s->roots.begin(), s->roots.end());
    const Index first = listed_;
    walk_children(roots);
    for (SubTree* s : subtrees) {
      s->first_task = first;
      s->end_task = listed_;
    }
  }

  // For every front: the first front of its sub-tree, the sub-tree's work and contributions, whether it is one range.
  void measure_subtrees() {
    const auto n = static_cast<std::size_t>(fronts_);
    subtree_begin_.resize(n);
    is_range_.assign(n, 0);
    entries_.assign(n, 0);
    std::vector<double> flops(n);
    for (Index f = 0; f < fronts_; ++f) {
      subtree_begin_[f] = f;
      bool all_ranges = true;
      double work = front_flops(plan_.layout[f].pivots, plan_.layout[f].rows, plan_.options.unsymmetric);
      for (Offset c = plan_.child_ptr[f]; c < plan_.child_ptr[f + 1]; ++c) {
        const Index child = plan_.children[c];
        subtree_begin_[f] = std::min(subtree_begin_[f], subtree_begin_[child]);
        all_ranges = all_ranges && is_range_[child] != 0;
        work += flops[child];
        entries_[f] += entries_[child];
      }
      flops[f] = work;
      is_range_[f] = static_cast<char>(all_ranges && plan_.whole[f] != 0 && work <= plan_.options.range_flops);
      if (is_range_[f] != 0) entries_[f] = 0;
      entries_[f] += plan_.layout[f].contribution_size();
    }
  }

  // Sub-trees side by side: small ones are gathered into groups, a large one is walked alone. An explicit stack keeps
  // deep trees (chains) from exhausting the thread's.
  void walk_children(const std::vector<Index>& roots) {
    struct Step {
      Index front;
      bool children_done;
    };
    std::vector<Step> stack;
    std::vector<Index> group;
    const auto push = [&](const auto& list) {
      for (auto it = list.rbegin(); it != list.rend(); ++it) stack.push_back({*it, false});
    };
    push(roots);
    Offset gathered = 0;
    const auto flush = [&] {
      if (!group.empty()) emit_group(group);
      group.clear();
      gathered = 0;
    };
    while (!stack.empty()) {
      const Step step = stack.back();
      stack.pop_back();
      const Index f = step.front;
      if (step.children_done) {
        flush();
        emit_tier({f});
      } else if (entries_[f] <= plan_.options.group_entries || is_range_[f] != 0) {
        if (gathered + entries_[f] > plan_.options.group_entries) flush();
        group.push_back(f);
        gathered += entries_[f];
      } else {
        stack.push_back({f, true});
        push(std::vector<Index>(plan_.children.begin() + plan_.child_ptr[f],
                                plan_.children.begin() + plan_.child_ptr[f + 1]));
      }
    }
    flush();
  }

  // All fronts of the sub-trees under `roots`, deepest tier first.
  void emit_group(const std::vector<Index>& roots) {
    std::vector<std::vector<Index>> tiers;
    std::vector<Index> now = roots;
    while (!now.empty()) {
      std::vector<Index> below;
      for (const Index f : now)
        if (is_range_[f] == 0)
          below.insert(below.end(), plan_.children.begin() + plan_.child_ptr[f],
                       plan_.children.begin() + plan_.child_ptr[f + 1]);
      tiers.push_back(std::move(now));
      now = std::move(below);
    }
    for (auto t = tiers.rbegin(); t != tiers.rend(); ++t) emit_tier(*t);
  }

  void emit_tier(const std::vector<Index>& tier) {
    std::vector<Index> tiled;
    for (const Index f : tier)
      if (plan_.whole[f] != 0)
        add_range(f);
      else
        tiled.push_back(f);
    // Largest first, so that the last ones to finish are small; the number decides among equals.
    std::stable_sort(tiled.begin(), tiled.end(),
                     [&](Index a, Index b) { return plan_.layout[a].tile_count() > plan_.layout[b].tile_count(); });
    const auto step = static_cast<std::size_t>(std::max<Index>(1, plan_.options.interleave));
    for (std::size_t b = 0; b < tiled.size(); b += step)
      for (const bool late : {false, true})
        add_tiles(std::span(tiled).subspan(b, std::min(step, tiled.size() - b)), late);
  }

  void add_range(Index f) {
    if (!is_made_here(plan_, f, 0)) return;
    add({f}, is_range_[f] != 0 ? subtree_begin_[f] : f, 1, is_late(f));
  }

  // The tiles of the fronts that are late, or of the others.
  void add_tiles(std::span<const Index> fronts, bool late) {
    std::vector<Index> some;
    Offset tasks = 0;
    for (const Index f : fronts) {
      if (is_late(f) != late) continue;
      some.push_back(f);
      tasks += tiles_made_here(f);
    }
    if (!some.empty()) add(some, -1, tasks, late);
  }

  [[nodiscard]] Offset tiles_made_here(Index f) const {
    const FrontLayout& l = plan_.layout[f];
    if (plan_.options.ranks == 1) return l.tile_count();
    Offset tasks = 0;
    for (Index j = 0; j < l.tiles; ++j) tasks += is_made_here(plan_, f, j) ? l.tiles - j : 0;
    return tasks;
  }

  void add(const std::vector<Index>& fronts, Index range, Offset tasks, bool late) {
    Index& end = late ? late_ : listed_;
    const auto begin = static_cast<Index>(grouped_.size());
    grouped_.insert(grouped_.end(), fronts.begin(), fronts.end());
    groups_.push_back({begin, static_cast<Index>(grouped_.size()), range, end, late});
    end += static_cast<Index>(tasks);
  }

  void write(const Group& group) {
    Index at = group.at + (group.late ? listed_ : 0);
    const std::span<const Index> fronts(grouped_.data() + group.begin, grouped_.data() + group.end);
    if (group.range < 0) return write_tiles(fronts, at);
    for (Index g = group.range; g <= fronts.front(); ++g) plan_.first_task[g] = plan_.last_task[g] = at;
    plan_.tasks[at] = {fronts.front(), group.range, 0, 0};
  }

  // The fronts advance together, one block column a step. What the next step depends on comes first: tile (s, s - 1),
  // which completes the row of the next diagonal tile, that diagonal tile, and only then the rest of column s - 1,
  // behind which the factorization of the diagonal tile hides.
  void write_tiles(std::span<const Index> fronts, Index& at) {
    Index steps = 0;
    for (const Index f : fronts) {
      steps = std::max(steps, plan_.layout[f].pivot_tiles);
      plan_.first_task[f] = -1;
    }
    for (Index s = 0; s <= steps; ++s) {
      for (const Index f : fronts)
        if (s > 0 && s <= plan_.layout[f].pivot_tiles && s < plan_.layout[f].tiles)
          write_column(f, s, s + 1, s - 1, at);
      for (const Index f : fronts)
        if (s < plan_.layout[f].pivot_tiles) write_column(f, s, s + 1, s, at);
      for (const Index f : fronts)
        if (s > 0 && s <= plan_.layout[f].pivot_tiles) write_column(f, s + 1, plan_.layout[f].tiles, s - 1, at);
    }
    for (const Index f : fronts)
      for (Index j = plan_.layout[f].pivot_tiles; j < plan_.layout[f].tiles; ++j)
        write_column(f, j, plan_.layout[f].tiles, j, at);
  }

  // Tiles begin .. end - 1 of block column j.
  void write_column(Index f, Index begin, Index end, Index j, Index& at) {
    if (begin >= end || !is_made_here(plan_, f, j)) return;
    if (plan_.first_task[f] < 0) plan_.first_task[f] = at;
    for (Index i = begin; i < end; ++i) plan_.tasks[at++] = {f, -1, i, j};
    plan_.last_task[f] = at - 1;
  }

  Plan& plan_;
  Index fronts_;
  std::vector<Index> subtree_begin_;
  std::vector<char> is_range_;
  std::vector<char> late_front_;  // fronts; see PlanOptions::narrow_first; empty: none is late
  std::vector<Group> groups_;
  std::vector<Index> grouped_;   // fronts of the groups, one group after another
  Index listed_ = 0, late_ = 0;  // tasks so far, and those that follow all others
  std::vector<Offset> entries_;  // contribution entries of a sub-tree that its group holds
};

}  // namespace

void list_tasks(Plan& plan, base::ThreadPool* pool) { TaskLister(plan).list(pool); }

Plan plan_for_one_device(const Plan& plan) {
  Plan one = plan;
  one.memory = MemoryPlan{};
  one.options.devices = 1;
  one.ownership = assign_owners(one);
  list_tasks(one);
  return one;
}

}  // namespace espalier::plan

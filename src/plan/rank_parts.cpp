#include "plan/rank_parts.hpp"

#include <algorithm>
#include <limits>
#include <utility>

#include "plan/memory_plan.hpp"

namespace espalier::plan {

namespace {

// The rank's sub-trees as a plan of one device: its tasks with which fronts begin and end. What goes to the top is made
// the contribution to a front that is never eliminated, the last one, so that it stays.
Plan subtrees_of(const Plan& plan, Index rank) {
  const auto n = static_cast<std::size_t>(plan.fronts());
  const Ownership& a = plan.ownership;
  Plan own;
  own.options = plan.options;
  own.options.devices = own.options.ranks = 1;
  own.tree.parent = plan.tree.parent;
  own.tree.parent.push_back(-1);
  for (std::size_t f = 0; f < n; ++f)
    if (Index& parent = own.tree.parent[f]; parent >= 0 && a.subtree(parent) < 0) parent = static_cast<Index>(n);
  own.layout = plan.layout;
  own.layout.emplace_back();
  own.whole = plan.whole;
  own.whole.push_back(1);
  own.child_ptr = plan.child_ptr;
  own.child_ptr.push_back(own.child_ptr.back());
  own.children = plan.children;
  own.first_task.assign(n + 1, -1);
  own.last_task.assign(n + 1, std::numeric_limits<Index>::max());
  for (const Task& task : plan.tasks) {
    const Index s = a.subtree(task.front);
    if (s < 0 || a.subtrees[static_cast<std::size_t>(s)].device != rank) continue;
    const auto at = static_cast<Index>(own.tasks.size());
    for (Index f = task.is_range() ? task.begin : task.front; f <= task.front; ++f) {
      if (own.first_task[f] < 0) own.first_task[f] = at;
      own.last_task[f] = at;
    }
    own.tasks.push_back(task);
  }
  return own;
}

class RankMemory {
 public:
  explicit RankMemory(const Plan& plan) : plan_(plan), rank_(plan.options.rank) {}

  MemoryPlan run() {
    Plan own = subtrees_of(plan_, rank_);
    plan_memory(own);
    m_ = std::move(own.memory);
    const auto n = static_cast<std::size_t>(plan_.fronts());
    for (auto* list : {&m_.factor, &m_.factor2, &m_.contribution, &m_.contribution2})
      if (!list->empty()) list->resize(n);
    m_.on_stack.resize(n);
    m_.wait_ptr.resize(n + 1);
    for (Index f = 0; f < plan_.fronts(); ++f) place(f);
    m_.device_size = {m_.size};
    return std::move(m_);
  }

 private:
  [[nodiscard]] Offset round(Offset x) const {
    const Offset p = plan_.options.tiles.panel;
    return (x + p - 1) / p * p;
  }
  [[nodiscard]] bool lu() const { return plan_.options.unsymmetric; }

  Offset take(Offset elements) {
    const Offset at = m_.size;
    m_.size += round(elements);
    return at;
  }

  void place(Index f) {
    const Index s = plan_.ownership.subtree(f);
    if (s >= 0 && plan_.ownership.subtrees[static_cast<std::size_t>(s)].device == rank_) return;
    const FrontLayout& l = plan_.layout[f];
    if (s < 0 && keeps_factor(plan_, f, rank_)) {
      const Offset before = m_.size;
      m_.factor[f] = take(l.factor_size());
      if (lu()) m_.factor2[f] = take(l.factor_size());
      m_.factor_size += m_.size - before;
      if (plan_.options.ldlt && plan_.whole[f] == 0) m_.factor2[f] = take(l.factor_size());
    }
    if (!works_with_contribution(f)) return;
    m_.contribution[f] = take(l.contribution_size());
    if (lu()) m_.contribution2[f] = take(l.contribution_size());
  }

  [[nodiscard]] bool works_with_contribution(Index f) const {
    const FrontLayout& l = plan_.layout[f];
    const Index parent = plan_.tree.parent[f];
    if (parent < 0 || plan_.ownership.subtree(parent) >= 0 || l.below() == 0 || !knows(plan_, f, rank_)) return false;
    const auto is_here = [&](const std::vector<Index>& ranks) {
      return std::find(ranks.begin(), ranks.end(), rank_) != ranks.end();
    };
    if (plan_.whole[f] != 0) return maker(plan_, f, 0) == rank_ || is_here(readers(plan_, f, -1));
    for (Index j = 0; j < l.tiles_below(); ++j)
      if (maker(plan_, f, l.pivot_tiles + j) == rank_ || is_here(readers(plan_, f, j))) return true;
    return false;
  }

  const Plan& plan_;
  Index rank_;
  MemoryPlan m_;
};

}  // namespace

bool keeps_factor(const Plan& plan, Index front, Index rank) {
  const Ownership& a = plan.ownership;
  if (const Index s = a.subtree(front); s >= 0) return a.subtrees[static_cast<std::size_t>(s)].device == rank;
  return a.members.empty() || (a.members[static_cast<std::size_t>(front)] >> rank & 1) != 0;
}

std::vector<Index> keepers(const Plan& plan, Index front) {
  std::vector<Index> list;
  for (Index r = 0; r < plan.ownership.devices; ++r)
    if (keeps_factor(plan, front, r)) list.push_back(r);
  return list;
}

Index maker(const Plan& plan, Index front, Index column) {
  return plan.ownership.owner(front, plan.whole[static_cast<std::size_t>(front)] != 0 ? 0 : column);
}

std::vector<Index> readers(const Plan& plan, Index front, Index column) {
  std::vector<Index> list;
  const Index parent = plan.tree.parent[front];
  if (parent < 0) return list;
  const FrontLayout& l = plan.layout[front];
  const Index first = column < 0 ? 0 : column * l.below_width;
  const Index end = column < 0 ? l.below() : first + l.below_rows(column);
  const Index* relative = plan.places_in_parent(front);
  Index last = -1;
  for (Index r = first; r < end; ++r) {
    const Index j = plan.layout[parent].tile_of(relative[r]);
    if (j == last) continue;
    last = j;
    list.push_back(maker(plan, parent, j));
  }
  std::sort(list.begin(), list.end());
  list.erase(std::unique(list.begin(), list.end()), list.end());
  return list;
}

bool knows(const Plan& plan, Index front, Index rank) {
  if (keeps_factor(plan, front, rank)) return true;
  const Index parent = plan.tree.parent[static_cast<std::size_t>(front)];
  return parent >= 0 && plan.ownership.subtree(parent) < 0 && keeps_factor(plan, parent, rank);
}

Index first_keeper(const Plan& plan, Index front) {
  Index r = 0;
  while (!keeps_factor(plan, front, r)) ++r;
  return r;
}

bool is_made_here(const Plan& plan, Index front, Index column) {
  return plan.options.ranks <= 1 || maker(plan, front, column) == plan.options.rank;
}

void number_known(Plan& plan) {
  plan.row_begin.assign(static_cast<std::size_t>(plan.fronts()) + 1, 0);
  for (Index f = 0; f < plan.fronts(); ++f) {
    const bool known = knows(plan, f, plan.options.rank);
    plan.row_begin[f + 1] = plan.row_begin[f] + (known ? plan.tree.rows_below(f) : 0);
    plan.first_tile[f + 1] = plan.first_tile[f] + (known ? plan.layout[f].tile_count() : 0);
  }
}

void drop_unknown_rows(Plan& plan) {
  base::LazyVector<Index> kept(static_cast<std::size_t>(plan.row_begin.back()));
  for (Index f = 0; f < plan.fronts(); ++f) {
    const Offset count = plan.row_begin[f + 1] - plan.row_begin[f];
    std::copy_n(plan.tree.rows.begin() + plan.tree.row_ptr[f], count, kept.begin() + plan.row_begin[f]);
  }
  plan.tree.rows = std::move(kept);
}

MemoryPlan memory_of_rank(const Plan& plan) { return RankMemory(plan).run(); }

}  // namespace espalier::plan

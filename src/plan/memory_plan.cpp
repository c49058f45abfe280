// Places for factors, contributions and work arrays: factors grow from the low end of one arena in the order of work,
// everything that dies lives at the high end, as in the classical multifrontal work array (Duff and Reid 1983), but
// with best-fit reuse instead of a stack, since the order of work is not a postorder. With one device, places at the
// high end are dealt out backwards in time: what lives last, when the factors leave the least room, gets the outermost
// places, and the gaps that reuse leaves lie where the factors are still short (elasticity 64^3 on a GPU: 16.5 GB, the
// sum of what lives at a time, instead of 19.3 forwards).
#include "plan/memory_plan.hpp"

#include <algorithm>
#include <deque>
#include <map>
#include <numeric>
#include <utility>

#include "plan/heap.hpp"

namespace espalier::plan {

namespace {

// Remembers which front last emptied each place of the arena.
class LastUse {
 public:
  // The region dies when `front` is finished.
  void dies(Offset at, Offset size, Index front) {
    cut(at, at + size);
    regions_[at] = {at + size, front};
  }
  // Appends the fronts that emptied parts of the region (each once) and forgets them.
  void reuse(Offset at, Offset size, std::vector<Index>& fronts) {
    const auto b = fronts.size();
    cut(at, at + size);
    for (auto it = regions_.lower_bound(at); it != regions_.end() && it->first < at + size;) {
      if (std::find(fronts.begin() + static_cast<std::ptrdiff_t>(b), fronts.end(), it->second.front) == fronts.end())
        fronts.push_back(it->second.front);
      it = regions_.erase(it);
    }
  }

 private:
  struct Region {
    Offset end;
    Index front;
  };
  // Makes `begin` and `end` boundaries of regions.
  void cut(Offset begin, Offset end) {
    split(begin);
    split(end);
  }
  void split(Offset at) {
    auto it = regions_.lower_bound(at);
    if (it == regions_.begin()) return;
    --it;
    if (it->second.end <= at) return;
    regions_[at] = it->second;
    it->second.end = at;
  }
  std::map<Offset, Region> regions_;
};

// One region at the high end: taken with task `first`, dead once front `freed_by` has been finished by task `last`.
struct Region {
  Offset size;
  Index first;
  Index last;
  Index freed_by;
  Offset at = 0;  // coordinate from the far end
};

class MemoryPlanner {
 public:
  // tasks: what plan.tasks are of a longer list; null: all
  MemoryPlanner(Plan& plan, const ArraySizes* sizes, const NumberedTasks* tasks = nullptr)
      : plan_(plan), sizes_(sizes), numbered_(tasks), m_(plan.memory), fronts_(plan.fronts()) {}

  void run() {
    m_ = MemoryPlan{};
    const auto n = static_cast<std::size_t>(fronts_);
    m_.factor.assign(n, 0);
    m_.contribution.assign(n, 0);
    m_.on_stack.assign(n, 0);
    if (two_factors()) m_.factor2.assign(n, 0);
    if (plan_.options.unsymmetric) m_.contribution2.assign(n, 0);
    contribution_.assign(n, {});
    work_.assign(n, {});
    m_.device_size.assign(static_cast<std::size_t>(plan_.ownership.devices), 0);
    find_turns();
    place();
    if (backwards()) place_backwards();
    share_memory();
    for (Index f = 0; f < fronts_; ++f) fix_addresses(f);
    find_waits();
  }

 private:
  [[nodiscard]] bool two_factors() const { return plan_.options.unsymmetric || plan_.options.ldlt; }
  [[nodiscard]] Offset round(Offset x) const {
    const Offset p = plan_.options.tiles.panel;
    return (x + p - 1) / p * p;
  }
  [[nodiscard]] Offset factor_entries(Index f) const {
    return sizes_ != nullptr ? sizes_->factor[f] : round(plan_.layout[f].factor_size());
  }
  [[nodiscard]] Offset contribution_entries(Index f) const {
    return sizes_ != nullptr ? sizes_->contribution[f] : round(plan_.layout[f].contribution_size());
  }

  [[nodiscard]] Index number(Index k) const {
    return numbered_ != nullptr ? numbered_->numbers[static_cast<std::size_t>(k)] : k;
  }

  // Between these tasks nothing is taken or given back. Several devices: all, since sub-trees change between them.
  void find_turns() {
    turns_.clear();
    if (numbered_ != nullptr || !backwards()) {
      turns_.resize(plan_.tasks.size());
      std::iota(turns_.begin(), turns_.end(), 0);
      return;
    }
    turns_.reserve(2 * static_cast<std::size_t>(fronts_));
    for (Index f = 0; f < fronts_; ++f) {
      if (plan_.first_task[f] < 0) continue;  // none is in the list
      turns_.push_back(plan_.first_task[f]);
      turns_.push_back(plan_.last_task[f]);
    }
    std::sort(turns_.begin(), turns_.end());
    turns_.erase(std::unique(turns_.begin(), turns_.end()), turns_.end());
  }
  [[nodiscard]] Offset all_tasks() const {
    return numbered_ != nullptr ? numbered_->all : static_cast<Offset>(plan_.tasks.size());
  }

  void take(std::vector<Region>& of, Index f, Offset size, Index last, Index freed_by) {
    Region& r = of[f];
    r = {size, plan_.first_task[f], last, freed_by};
    if (size == 0) return;
    if (backwards())
      regions_.push_back(&r);
    else
      r.at = heap_.take(size);
  }

  [[nodiscard]] bool backwards() const { return plan_.ownership.devices == 1; }
  [[nodiscard]] bool keeps_contributions() const { return plan_.options.keep_contributions; }

  // Among the factors, where nothing is ever taken over by others.
  void keep_contribution(Index f, Offset size) {
    m_.contribution[f] = factor_end_;
    if (plan_.options.unsymmetric) m_.contribution2[f] = factor_end_ + contribution_entries(f);
    factor_end_ += size;
  }

  void begin_front(Index f) {
    m_.factor[f] = factor_end_;
    factor_end_ += factor_entries(f);
    if (plan_.options.unsymmetric) {
      m_.factor2[f] = factor_end_;
      factor_end_ += factor_entries(f);
    } else if (plan_.options.ldlt && plan_.whole[f] == 0) {
      // Where some fronts are not made, waiting for the last one that had a place is not enough.
      if (keeps_contributions()) {
        m_.factor2[f] = factor_end_;
        factor_end_ += factor_entries(f);
      } else {
        take(work_, f, factor_entries(f), plan_.last_task[f], f);
      }
    }
    if (!keeps_contributions()) factor_ends_.emplace_back(plan_.first_task[f], factor_end_);
    const Index parent = plan_.tree.parent[f];
    const Offset contribution = contribution_entries(f) * (plan_.options.unsymmetric ? 2 : 1);
    if (m_.on_stack[f] == 0 && parent >= 0 && keeps_contributions())
      keep_contribution(f, contribution);
    else if (m_.on_stack[f] == 0 && parent >= 0)
      take(contribution_, f, contribution, plan_.last_task[parent], parent);
    else if (parent < 0 && plan_.tree.border > 0)  // what is left for the border stays
      take(contribution_, f, contribution, static_cast<Index>(all_tasks()), f);
  }

  void end_front(Index f, Index task) {
    const Index ready = task + plan_.options.reuse_distance;
    for (Offset c = plan_.child_ptr[f]; c < plan_.child_ptr[f + 1]; ++c)
      release(contribution_[plan_.children[c]], ready);
    release(work_[f], ready);
  }

  void release(const Region& r, Index ready) {
    if (r.size > 0 && !backwards()) waiting_.push_back({ready, r.at, r.size});
  }

  // Several devices: the list goes on to another sub-tree, or from the last one to the top (-1).
  void enter(Index subtree) {
    for (const Waiting& w : waiting_) heap_.give_back(w.at, w.size);
    waiting_.clear();
    heap_.set_aside();
    leave();
    subtree_ = subtree;
    if (subtree < 0) heap_.restore();
  }
  // Counts what the sub-tree took.
  void leave() {
    if (subtree_ >= 0)
      m_.device_size[plan_.ownership.subtrees[subtree_].device] += factor_end_ + heap_.high() - counted_;
    counted_ = factor_end_ + heap_.high();
  }

  // Several devices: nothing of one device's lies where another's factors go, and everybody has a part of the top.
  void share_memory() {
    const Ownership& a = plan_.ownership;
    if (a.devices == 1) {
      m_.device_size[0] = m_.size;
      return;
    }
    if (subtree_ >= 0) leave();
    m_.size = factor_end_ + heap_.high();
    Offset rest = m_.size - counted_;
    const Offset copies = plan_.options.unsymmetric ? 2 : 1;
    for (Index f = 0; f < fronts_; ++f) {
      if (a.subtree(f) >= 0) continue;
      const FrontLayout& l = plan_.layout[f];
      for (Index j = 0; j < l.pivot_tiles; ++j) {
        const Offset end = j + 1 < l.pivot_tiles ? l.tile_offset(j + 1, j + 1) : l.factor_size();
        const Offset column = copies * (end - l.tile_offset(j, j));
        m_.device_size[a.owner(f, j)] += column;
        rest -= column;
      }
    }
    for (Offset& size : m_.device_size) size += (rest + a.devices - 1) / a.devices;
  }

  void place() {
    for (const Index k : turns_) {
      const Task& task = plan_.tasks[static_cast<std::size_t>(k)];
      const Index at = number(k);
      if (plan_.ownership.subtree(task.front) != subtree_) enter(plan_.ownership.subtree(task.front));
      while (!waiting_.empty() && waiting_.front().ready <= at) {
        heap_.give_back(waiting_.front().at, waiting_.front().size);
        waiting_.pop_front();
      }
      if (task.is_range()) {
        place_on_stack(plan_, task, m_, [this](Index f) { return contribution_entries(f); });
        for (Index f = task.begin; f <= task.front; ++f) begin_front(f);
      } else if (plan_.first_task[task.front] == at) {
        begin_front(task.front);
      }
      m_.size = std::max(m_.size, factor_end_ + heap_.extent());
      if (plan_.last_task[task.front] == at) end_front(task.front, at);
    }
    m_.factor_size = factor_end_;
  }

  // Places for all regions, the last to die first. A region is taken before task `first` and free again before task
  // free_again().
  void place_backwards() {
    const auto free_again = [&](const Region* r) {
      return std::min(static_cast<Offset>(r->last) + std::max<Index>(1, plan_.options.reuse_distance), all_tasks());
    };
    std::vector<const Region*> births(regions_.begin(), regions_.end());
    std::stable_sort(births.begin(), births.end(), [](auto* a, auto* b) { return a->first > b->first; });
    std::stable_sort(regions_.begin(), regions_.end(), [&](auto* a, auto* b) {
      return free_again(a) != free_again(b) ? free_again(a) > free_again(b) : a->size > b->size;
    });
    auto born = births.begin();
    m_.size = factor_end_;
    for (Region* r : regions_) {
      const Offset now = free_again(r);
      for (; born != births.end() && (*born)->first >= now; ++born) heap_.give_back((*born)->at, (*born)->size);
      while (!factor_ends_.empty() && factor_ends_.back().first >= now) factor_ends_.pop_back();
      r->at = heap_.take(r->size);
      m_.size = std::max(m_.size, factor_end_of_now() + heap_.extent());
    }
  }

  // While places are dealt backwards. Where a front is made again later, factors and what is kept are all there.
  [[nodiscard]] Offset factor_end_of_now() const {
    if (keeps_contributions()) return factor_end_;
    return factor_ends_.empty() ? 0 : factor_ends_.back().second;
  }

  void fix_addresses(Index f) {
    Region& c = contribution_[f];
    c.at = m_.size - c.at - c.size;
    if (c.size > 0) {
      m_.contribution[f] = c.at;
      if (plan_.options.unsymmetric) m_.contribution2[f] = c.at + contribution_entries(f);
    }
    Region& w = work_[f];
    w.at = m_.size - w.at - w.size;
    if (w.size > 0) m_.factor2[f] = w.at;
  }

  // Replays the order of work with final addresses and collects, for every front, whom it must wait for.
  void find_waits() {
    LastUse last_use;
    std::vector<std::vector<Index>> waits(static_cast<std::size_t>(fronts_));
    const auto begin = [&](Index f, Index waiter) {
      auto& list = waits[waiter];
      const Offset copies = plan_.options.unsymmetric ? 2 : 1;
      last_use.reuse(m_.factor[f], copies * factor_entries(f), list);
      if (contribution_[f].size > 0) last_use.reuse(contribution_[f].at, contribution_[f].size, list);
      if (work_[f].size > 0) last_use.reuse(work_[f].at, work_[f].size, list);
    };
    for (const Index k : turns_) {
      const Task& task = plan_.tasks[static_cast<std::size_t>(k)];
      const Index at = number(k);
      const Index f = task.front;
      if (task.is_range())
        for (Index g = task.begin; g <= f; ++g) begin(g, f);  // the whole range waits once
      else if (plan_.first_task[f] == at)
        begin(f, f);
      if (plan_.last_task[f] != at) continue;
      for (Offset c = plan_.child_ptr[f]; c < plan_.child_ptr[f + 1]; ++c) {
        const Region& r = contribution_[plan_.children[c]];
        if (r.size > 0) last_use.dies(r.at, r.size, f);
      }
      if (work_[f].size > 0) last_use.dies(work_[f].at, work_[f].size, f);
    }
    m_.wait_ptr.assign(static_cast<std::size_t>(fronts_) + 1, 0);
    for (Index f = 0; f < fronts_; ++f) {
      std::sort(waits[f].begin(), waits[f].end());
      waits[f].erase(std::unique(waits[f].begin(), waits[f].end()), waits[f].end());
      m_.wait_fronts.insert(m_.wait_fronts.end(), waits[f].begin(), waits[f].end());
      m_.wait_ptr[f + 1] = static_cast<Offset>(m_.wait_fronts.size());
    }
  }

  struct Waiting {
    Index ready;
    Offset at;
    Offset size;
  };

  Plan& plan_;
  const ArraySizes* sizes_;
  const NumberedTasks* numbered_;
  MemoryPlan& m_;
  Index fronts_;
  Heap heap_;
  Offset factor_end_ = 0;
  Index subtree_ = -1;                                 // of the task being placed; -1: the top
  Offset counted_ = 0;                                 // elements that belong to sub-trees
  std::vector<Index> turns_;                           // tasks with which fronts begin or end, ascending
  std::vector<Region*> regions_;                       // backwards: all that have a size
  std::vector<std::pair<Index, Offset>> factor_ends_;  // fronts as they begin: task, end of their factors
  std::deque<Waiting> waiting_;                        // dead regions that may not be reused yet, by rising `ready`
  std::vector<Region> contribution_;                   // by front
  std::vector<Region> work_;                           // by front: L D of ldlt
};

}  // namespace

void plan_memory(Plan& plan, const ArraySizes* sizes, int threads) {
  if (sizes != nullptr && !sizes->region.empty())
    plan.memory = plan_regions(plan, *sizes, threads);
  else
    MemoryPlanner(plan, sizes).run();
}

void plan_memory(Plan& plan, const ArraySizes& sizes, const NumberedTasks& tasks) {
  MemoryPlanner(plan, &sizes, &tasks).run();
}

}  // namespace espalier::plan

#include "plan/kept_places.hpp"

#include <algorithm>
#include <utility>
#include <vector>

#include "plan/heap.hpp"
#include "plan/memory_plan.hpp"

namespace espalier::plan {

namespace {

bool gives_nothing_away(const Plan& plan) {
  const PlanOptions& o = plan.options;
  return o.keep_contributions && o.devices == 1 && o.ranks == 1 && plan.tree.border == 0;
}

bool cuts_alike(const TileRule& a, const TileRule& b) {
  return a.panel == b.panel && a.whole_rows == b.whole_rows && a.whole_pivots == b.whole_pivots &&
         a.max_block_size == b.max_block_size && a.narrow_rows == b.narrow_rows && a.narrow_width == b.narrow_width &&
         a.even == b.even;
}

bool places_can_stay(const Plan& plan, const Plan& before) {
  return gives_nothing_away(plan) && gives_nothing_away(before) && plan.options.arrays == before.options.arrays &&
         cuts_alike(plan.options.tiles, before.options.tiles) &&
         plan.options.unsymmetric == before.options.unsymmetric && plan.options.ldlt == before.options.ldlt;
}

class PlaceKeeper {
 public:
  PlaceKeeper(Plan& plan, const Plan& before, std::span<const Index> same)
      : plan_(plan), m_(plan.memory), was_(before), same_(same), fronts_(static_cast<std::size_t>(plan.fronts())) {}

  bool run() {
    begin();
    list_staying();
    leave_holes();
    for (const auto& [place, size] : open_) *place = heap_.take(size);
    const Offset first = was_.memory.size - was_.memory.added;
    constexpr double kLeast = 0.7;
    if (heap_.high() > elements_with_room(was_.memory) ||
        static_cast<double>(needed_) < kLeast * static_cast<double>(first)) {
      m_ = MemoryPlan{};
      return false;
    }
    m_.size = std::max(first, heap_.high());
    m_.added = m_.size - first;
    m_.factor_size = needed_;
    m_.device_size.assign(1, m_.size);
    return true;
  }

 private:
  [[nodiscard]] Offset round(Offset x) const {
    const Offset p = plan_.options.tiles.panel;
    return (x + p - 1) / p * p;
  }
  [[nodiscard]] Offset factor_size(Index f) const {
    const ArrayLayout* arrays = plan_.options.arrays;
    return arrays != nullptr ? arrays->factor_elements(plan_.layout[f], plan_.form(f))
                             : round(plan_.layout[f].factor_size());
  }
  [[nodiscard]] Offset contribution_size(Index f) const {
    const ArrayLayout* arrays = plan_.options.arrays;
    return arrays != nullptr ? arrays->contribution_elements(plan_.layout[f], plan_.form(f))
                             : round(plan_.layout[f].contribution_size());
  }

  void begin() {
    m_ = MemoryPlan{};
    m_.factor.assign(fronts_, 0);
    m_.contribution.assign(fronts_, 0);
    m_.on_stack.assign(fronts_, 0);
    if (plan_.options.unsymmetric || plan_.options.ldlt) m_.factor2.assign(fronts_, 0);
    if (plan_.options.unsymmetric) m_.contribution2.assign(fronts_, 0);
    m_.wait_ptr.assign(fronts_ + 1, 0);  // nobody takes what others had
    for (const Task& task : plan_.tasks)
      if (task.is_range()) place_on_stack(plan_, task, m_, [this](Index f) { return contribution_size(f); });
  }

  // The place of an array; `before`: where it has lain, -1: it is another one, or had no place.
  void list(Offset* place, Offset size, Offset before) {
    needed_ += size;
    if (before < 0) {
      open_.emplace_back(place, size);
      return;
    }
    *place = before;
    taken_.emplace_back(before, size);
  }

  // In the order of work, as plan_memory() would.
  void list_staying() {
    for (const Task& task : plan_.tasks) {
      if (!task.is_range() && plan_.first_task[task.front] != &task - plan_.tasks.data()) continue;
      for (Index f = task.is_range() ? task.begin : task.front; f <= task.front; ++f) list_front(f);
    }
  }

  void list_front(Index f) {
    const MemoryPlan& was = was_.memory;
    const Index o = same_[f];
    const bool lu = plan_.options.unsymmetric;
    const Offset size = factor_size(f);
    const auto place_of = [&](const std::vector<Offset>& places) { return o < 0 ? -1 : places[o]; };
    list(&m_.factor[f], size, place_of(was.factor));
    if (lu || (plan_.options.ldlt && plan_.whole[f] == 0)) list(&m_.factor2[f], size, place_of(was.factor2));
    if (m_.on_stack[f] != 0 || plan_.tree.parent[f] < 0) return;
    const Offset left = contribution_size(f);
    const bool was_there = o >= 0 && was.on_stack[o] == 0 && was_.tree.parent[o] >= 0;
    list(&m_.contribution[f], left, was_there ? was.contribution[o] : -1);
    if (lu) list(&m_.contribution2[f], left, was_there ? was.contribution2[o] : -1);
  }

  void leave_holes() {
    std::sort(taken_.begin(), taken_.end());
    if (taken_.empty()) return;
    (void)heap_.take(taken_.back().first + taken_.back().second);
    Offset end = 0;
    for (const auto& [at, size] : taken_) {
      if (at > end) heap_.give_back(end, at - end);
      end = std::max(end, at + size);
    }
  }

  Plan& plan_;
  MemoryPlan& m_;
  const Plan& was_;
  std::span<const Index> same_;
  std::size_t fronts_;
  Heap heap_;
  Offset needed_ = 0;
  std::vector<std::pair<Offset, Offset>> taken_;  // start, size
  std::vector<std::pair<Offset*, Offset>> open_;  // where the start goes, size
};

bool same_children(const Plan& plan, Index f, const Plan& before, Index o, std::span<const Index> same) {
  const Index* mine = plan.children.data() + plan.child_ptr[f];
  const Index* its = before.children.data() + before.child_ptr[o];
  return std::equal(mine, plan.children.data() + plan.child_ptr[f + 1], its,
                    before.children.data() + before.child_ptr[o + 1],
                    [&](Index child, Index then) { return same[child] == then; });
}

bool same_places(const Plan& plan, Index f, const Plan& before, Index o) {
  const MemoryPlan &m = plan.memory, &was = before.memory;
  const bool lu = plan.options.unsymmetric;
  if (m.factor[f] != was.factor[o] || (lu && m.factor2[f] != was.factor2[o])) return false;
  const bool passed_on = plan.tree.parent[f] >= 0 && plan.layout[f].contribution_size() > 0 && m.on_stack[f] == 0;
  if (!passed_on) return true;
  return was.on_stack[o] == 0 && before.tree.parent[o] >= 0 && m.contribution[f] == was.contribution[o] &&
         (!lu || m.contribution2[f] == was.contribution2[o]);
}

}  // namespace

bool place_as_before(Plan& plan, const Plan& before, std::span<const Index> same) {
  return places_can_stay(plan, before) && PlaceKeeper(plan, before, same).run();
}

FrontsBefore fronts_that_stay(const Plan& plan, const Plan& before, std::span<const Index> same) {
  FrontsBefore stay{{}, {}, true};
  stay.same.assign(static_cast<std::size_t>(plan.fronts()), -1);
  if (!places_can_stay(plan, before)) return stay;
  for (Index f = 0; f < plan.fronts(); ++f)
    if (const Index o = same[f]; o >= 0 && plan.layout[f].pivots == before.layout[o].pivots &&
                                 plan.layout[f].rows == before.layout[o].rows && plan.whole[f] == before.whole[o] &&
                                 same_children(plan, f, before, o, same) && same_places(plan, f, before, o))
      stay.same[f] = o;
  return stay;
}

}  // namespace espalier::plan

#include "device/host/solve_schedule.hpp"

#include <algorithm>
#include <limits>

namespace espalier::device::host {

namespace {

using plan::FrontLayout;

// Fronts with more entries of the factor are split into tiles.
constexpr Offset kSplitEntries = 1 << 18;

}  // namespace

SolveSchedule::SolveSchedule(const plan::Plan& plan, const SolveShare* share) : plan_(plan) {
  list_tasks(share);
  place_contributions();
  if (share != nullptr) place_others(*share);
}

void SolveSchedule::list_tasks(const SolveShare* share) {
  const Index fronts = plan_.fronts();
  std::vector<Offset> entries(static_cast<std::size_t>(fronts), 0);
  std::vector<Index> begin(static_cast<std::size_t>(fronts));
  tiles_.assign(static_cast<std::size_t>(fronts), 1);
  for (Index f = 0; f < fronts; ++f) {
    const FrontLayout& l = plan_.layout[f];
    largest_front_rows_ = std::max(largest_front_rows_, static_cast<Index>(l.padded_begin(l.tiles)));
    for (Index i = 0; i < l.tiles; ++i)
      largest_tile_ = std::max(largest_tile_, static_cast<Index>(l.padded(l.width(i))));
    entries[f] += l.factor_size();
    begin[f] = f;
    for (Offset c = plan_.child_ptr[f]; c < plan_.child_ptr[f + 1]; ++c) {
      begin[f] = std::min(begin[f], begin[plan_.children[c]]);
      entries[f] += entries[plan_.children[c]];
    }
  }
  const auto small = [&](Index f) {
    return entries[f] <= kSolveTaskEntries && (share == nullptr || share->is_alone(f));
  };
  for (Index f = 0; f < fronts; ++f) {
    if (share != nullptr && !share->takes(f)) continue;
    const Index parent = plan_.tree.parent[f];
    const FrontLayout& l = plan_.layout[f];
    if (small(f)) {
      if (parent < 0 || !small(parent)) forward_.push_back({f, begin[f], -1});
    } else if (l.factor_size() <= kSplitEntries || l.tiles < 3) {
      forward_.push_back({f, f, -1});
    } else {
      tiles_[f] = l.tiles;
      for (Index i = 0; i < l.tiles; ++i) forward_.push_back({f, f, i});
    }
  }
  // Deepest tier first: what is ready together stands together.
  std::stable_sort(forward_.begin(), forward_.end(),
                   [&](const SolveTask& a, const SolveTask& b) { return plan_.tier[a.front] > plan_.tier[b.front]; });
  list_backward();
}

void SolveSchedule::list_backward() {
  backward_.clear();
  // Backwards, only the pivot columns of a split front have work.
  for (auto t = forward_.rbegin(); t != forward_.rend(); ++t)
    if (t->tile < plan_.layout[t->front].pivot_tiles) backward_.push_back(*t);
}

void SolveSchedule::follow(std::span<const Offset> place) {
  const auto at = [&](const SolveTask& task) {
    const Offset first = place[static_cast<std::size_t>(task.front)];
    return first < 0 ? std::numeric_limits<Offset>::max() : first;
  };
  std::stable_sort(forward_.begin(), forward_.end(),
                   [&](const SolveTask& a, const SolveTask& b) { return at(a) < at(b); });
  list_backward();
}

// Inside a range the children of a front are on top of the stack when their parent is reached, and it takes their
// place.
void SolveSchedule::place_contributions() {
  const auto fronts = static_cast<std::size_t>(plan_.fronts());
  place_.assign(fronts, 0);
  on_stack_.assign(fronts, 0);
  for (const SolveTask& task : forward_) {
    Offset top = 0;
    for (Index f = task.begin; f < task.front; ++f) {
      for (Offset c = plan_.child_ptr[f]; c < plan_.child_ptr[f + 1]; ++c)
        top -= plan_.layout[plan_.children[c]].below();
      on_stack_[f] = 1;
      place_[f] = top;
      top += plan_.layout[f].below();
      stack_rows_ = std::max(stack_rows_, top);
    }
    if (task.tile > 0) continue;
    place_[task.front] = contribution_rows_;
    contribution_rows_ += plan_.layout[task.front].below();
  }
}

// What comes from children that other ranks take.
void SolveSchedule::place_others(const SolveShare& share) {
  for (const SolveTask& task : forward_) {
    if (task.tile > 0 || share.is_alone(task.front)) continue;
    for (Offset c = plan_.child_ptr[task.front]; c < plan_.child_ptr[task.front + 1]; ++c) {
      const Index child = plan_.children[c];
      if (share.takes(child)) continue;
      place_[child] = contribution_rows_;
      contribution_rows_ += plan_.layout[child].below();
    }
  }
}

}  // namespace espalier::device::host

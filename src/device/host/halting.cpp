#include "device/host/halting.hpp"

#include <algorithm>

#include "base/at.hpp"
#include "device/host/kept_fronts.hpp"

namespace espalier::device::host {

template <class T>
bool LeftInArena<T>::has(Index f) const {
  const Index parent = s_.plan.tree.parent[f];
  return s_.verdict.value(f) == kVerdictGood && s_.plan.memory.on_stack[f] == 0 && parent >= 0 &&
         s_.verdict.value(parent) != kVerdictGood;
}

template <class T>
void LeftInArena<T>::copy(Index f, WideOf<T>* to) const {
  const plan::FrontLayout& l = s_.plan.layout[f];
  const Offset rows = l.below();
  const auto copy_part = [&](const T* from, bool upper) {
    for (Index j = 0; j < l.tiles_below(); ++j)
      for (Index i = j; i < l.tiles_below(); ++i) {
        const T* tile = from + l.contribution_offset(i, j);
        for (Index c = 0; c < l.below_rows(j); ++c)
          for (Index r = 0; r < l.below_rows(i); ++r) {
            const Offset row = Offset{i} * l.below_width + r, col = Offset{j} * l.below_width + c;
            if (row < col || (upper && row == col)) continue;
            const auto value = static_cast<WideOf<T>>(tile[c * l.contribution_ld(i) + r]);
            (upper ? to[row * rows + col] : to[col * rows + row]) = value;
          }
      }
  };
  copy_part(s_.places + s_.plan.memory.contribution[f], false);
  if (s_.kind == Kind::lu) copy_part(s_.places + s_.plan.memory.contribution2[f], true);
}

template <class T>
bool memory_is_free(const NumericState<T>& s, Index f, double* waited) {
  const plan::MemoryPlan& m = s.plan.memory;
  bool good = true;
  for (Offset q = m.wait_ptr[f]; q < m.wait_ptr[f + 1]; ++q) {
    s.front_done.wait(m.wait_fronts[q], s.abort, waited);
    good = good && s.verdict.value(m.wait_fronts[q]) == kVerdictGood;
  }
  return good || !s.keeps_what_is_left;
}

template <class T>
bool children_are_good(const NumericState<T>& s, Index f, double* waited) {
  bool good = true;
  for (Offset c = s.plan.child_ptr[f]; c < s.plan.child_ptr[f + 1]; ++c) {
    s.verdict.wait(s.plan.children[c], s.abort, waited);
    good = good && s.verdict.value(s.plan.children[c]) == kVerdictGood;
  }
  return good;
}

template <class T>
void judge_front(NumericState<T>& s, Index f) {
  const char* state = s.column_state.data();
  const int bad = s.rule.in_place_of_zero > 0 ? kColumnFailed : kColumnReplaced | kColumnFailed;
  const bool failed = std::any_of(state + s.plan.tree.first[f], state + s.plan.tree.first[f + 1],
                                  [bad](char c) { return (c & bad) != 0; });
  s.verdict.set(f, failed ? kVerdictFailed : kVerdictGood);
}

template <class T>
std::vector<char> fronts_begun(const NumericState<T>& s, const plan::Plan& changed, const plan::FrontsBefore& before) {
  std::vector<char> begun(at(changed.fronts()), 0);
  std::vector<Index> name(at(s.plan.fronts()), -1);
  for (std::size_t f = 0; f < before.front.size(); ++f) name[at(before.front[f])] = static_cast<Index>(f);
  for (Index f = 0; f < s.plan.fronts(); ++f) {
    Index heir = f;  // of a front that has vanished: whoever waits in its place
    while (heir >= 0 && name[at(heir)] < 0) heir = s.plan.tree.parent[heir];
    if (heir >= 0 && was_begun(s, f)) begun[at(name[at(heir)])] = 1;
  }
  return begun;
}

template <class T>
NumericState<T>::NumericState(const plan::Plan& changed, const plan::FrontsBefore& before, std::vector<char> keep,
                              const NumericState& from, base::MemoryBudget* budget)
    : NumericState(changed, {from.kind, from.hermitian}, from.rule, budget, 0) {
  if (!before.of_pattern) begun = fronts_begun(from, changed, before);
  kept = std::move(keep);
  halting = from.halting;
  for (Index f = 0; f < changed.fronts(); ++f) {
    if (!is_kept(f)) continue;
    const Index old = before.same[at(f)], size = changed.tree.pivots(f);
    const Index here = changed.tree.first[f], there = from.plan.tree.first[old];
    const auto take_over = [&](const auto& of, auto& to) {
      if (to.size() > 0) std::copy(of.data() + there, of.data() + there + size, to.data() + here);
    };
    take_over(from.pivot_order, pivot_order);
    take_over(from.d_inverse, d_inverse);
    take_over(from.e_inverse, e_inverse);
    take_over(from.column_state, column_state);
    fronts[at(f)] = from.fronts[at(old)];
  }
}

template <class T>
void NumericState<T>::take_arena(NumericState& from) {
  from.arena_share.grow((plan.memory.size - from.plan.memory.size) * static_cast<Offset>(sizeof(T)));
  arena_share = std::move(from.arena_share);
  arena = std::move(from.arena);
  places = arena.data();
}

#define ESPALIER_INSTANTIATE(T)                                                                                  \
  template bool memory_is_free(const NumericState<T>&, Index, double*);                                          \
  template bool children_are_good(const NumericState<T>&, Index, double*);                                       \
  template void judge_front(NumericState<T>&, Index);                                                            \
  template std::vector<char> fronts_begun(const NumericState<T>&, const plan::Plan&, const plan::FrontsBefore&); \
  template NumericState<T>::NumericState(const plan::Plan&, const plan::FrontsBefore&, std::vector<char>,        \
                                         const NumericState<T>&, base::MemoryBudget*);                           \
  template void NumericState<T>::take_arena(NumericState<T>&);                                                   \
  template class LeftInArena<T>;
ESPALIER_FOR_SCALARS(ESPALIER_INSTANTIATE)
#undef ESPALIER_INSTANTIATE

}  // namespace espalier::device::host

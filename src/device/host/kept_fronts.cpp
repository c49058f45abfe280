#include "device/host/kept_fronts.hpp"

#include <algorithm>

#include "base/at.hpp"
#include "plan/reached_fronts.hpp"

namespace espalier::device::host {

namespace {

// Fronts that must be made again, in numbers of the plan before; closed under all that follows from one of them.
template <class T>
class Again {
 public:
  // @param all_begun  all fronts have been made, whatever their verdicts say
  explicit Again(const NumericState<T>& s, bool all_begun = false)
      : s_(s), all_begun_(all_begun), plan_(s.plan), must_(at(plan_.fronts())), range_begin_(must_.size()) {
    for (Index f = 0; f < plan_.fronts(); ++f) range_begin_[at(f)] = f;
    for (const plan::Task& t : plan_.tasks)
      if (t.is_range()) range_begin_[at(t.front)] = t.begin;
    list_waiters();
  }

  void add(Index f) {
    if (must_[at(f)] != 0) return;
    must_[at(f)] = 1;
    open_.push_back(f);
  }

  std::vector<char> close() {
    while (!open_.empty()) {
      const Index f = open_.back();
      open_.pop_back();
      if (plan_.tree.parent[f] >= 0) add(plan_.tree.parent[f]);
      const bool lost = add_waiters(f);
      for (Offset c = plan_.child_ptr[f]; c < plan_.child_ptr[f + 1]; ++c)
        if (lost || plan_.memory.on_stack[plan_.children[c]] != 0) add(plan_.children[c]);
    }
    return std::move(must_);
  }

 private:
  void list_waiters() {
    const plan::MemoryPlan& m = plan_.memory;
    waiter_ptr_.assign(must_.size() + 1, 0);
    for (const Index f : m.wait_fronts) ++waiter_ptr_[at(f) + 1];
    for (std::size_t f = 0; f < must_.size(); ++f) waiter_ptr_[f + 1] += waiter_ptr_[f];
    waiter_.resize(m.wait_fronts.size());
    std::vector<Offset> next(waiter_ptr_.begin(), waiter_ptr_.end() - 1);
    for (Index g = 0; g < plan_.fronts(); ++g)
      for (Offset q = m.wait_ptr[g]; q < m.wait_ptr[g + 1]; ++q) waiter_[next[at(m.wait_fronts[q])]++] = g;
  }

  // Those that have taken over memory which f and its children had. @returns whether there are any
  bool add_waiters(Index f) {
    if (plan_.options.keep_contributions) return false;  // nothing is taken over that is of use later
    bool any = false;
    for (Offset q = waiter_ptr_[at(f)]; q < waiter_ptr_[at(f) + 1]; ++q) {
      const Index last = waiter_[q], first = range_begin_[at(last)];
      bool begun = false;
      for (Index g = first; g <= last && !begun; ++g) begun = all_begun_ || was_begun(s_, g);
      if (!begun) continue;
      any = true;
      for (Index g = first; g <= last; ++g) add(g);
    }
    return any;
  }

  const NumericState<T>& s_;
  bool all_begun_;
  const plan::Plan& plan_;
  std::vector<char> must_;
  std::vector<Index> range_begin_;  // by the last front of a range; else the front itself
  std::vector<Offset> waiter_ptr_;
  std::vector<Index> waiter_;
  std::vector<Index> open_;
};

}  // namespace

template <class T>
std::vector<char> fronts_to_keep(const NumericState<T>& s, const plan::Plan& changed,
                                 const plan::FrontsBefore& before) {
  Again<T> again(s);
  std::vector<char> same(at(s.plan.fronts()), 0);
  for (const Index f : before.same)
    if (f >= 0) same[at(f)] = 1;
  for (Index f = 0; f < s.plan.fronts(); ++f)
    if (same[at(f)] == 0 || s.verdict.value(f) != kVerdictGood) again.add(f);
  const std::vector<char> must = again.close();
  std::vector<char> keep(at(changed.fronts()), 0);
  for (std::size_t f = 0; f < keep.size(); ++f)
    keep[f] = static_cast<char>(before.same[f] >= 0 && must[at(before.same[f])] == 0);
  return keep;
}

namespace {

template <class T>
bool all_fine(const NumericState<T>& s, Index f) {
  const char* state = s.column_state.data();
  return std::all_of(state + s.plan.tree.first[at(f)], state + s.plan.tree.first[at(f) + 1],
                     [](char c) { return c == kColumnFine; });
}

}  // namespace

template <class T>
std::vector<char> changed_fronts(const NumericState<T>& s, std::span<const T> values, std::span<const T> before,
                                 const PivotRule& rule, base::ThreadPool& pool) {
  const auto fronts = at(s.plan.fronts());
  const PivotRule& was = s.rule;
  const bool llt = s.kind == Kind::llt;  // judges its pivots by their own entries of the matrix
  const bool same_rule =
      rule.threshold == was.threshold &&
      (llt || (rule.tiny == was.tiny && rule.in_place_of_zero == was.in_place_of_zero && rule.suspect == was.suspect));
  // Tests against `tiny` must be none of the pivots that `suspect` lets pass.
  const bool near_rule = rule.threshold == was.threshold && rule.tiny < rule.suspect && was.tiny < was.suspect &&
                         (rule.in_place_of_zero > 0) == (was.in_place_of_zero > 0);
  if (!same_rule && !near_rule) return std::vector<char>(fronts, 1);
  std::vector<char> other(fronts, 0);
  constexpr std::int64_t kFronts = 64;
  pool.for_each_range(static_cast<std::int64_t>(fronts), kFronts, [&](std::int64_t begin, std::int64_t end) {
    for (auto k = begin; k < end; ++k) {
      const auto f = static_cast<Index>(k);
      // What failed may halt the factorization, or be nothing by the other rule.
      const bool alike =
          same_rule ? !s.halting || all_fine(s, f) : all_fine(s, f) && s.fronts[at(f)].least_pivot >= rule.suspect;
      other[at(f)] = static_cast<char>(!alike || plan::entries_differ(s.plan, f, values, before));
    }
  });
  return other;
}

template <class T>
std::vector<char> unchanged_fronts(const NumericState<T>& s, std::span<const T> values, std::span<const T> before,
                                   const PivotRule& rule, base::ThreadPool& pool, std::span<const char> made) {
  const std::vector<char> other = changed_fronts(s, values, before, rule, pool);
  Again<T> again(s, true);
  for (std::size_t f = 0; f < other.size(); ++f)
    if (other[f] != 0 || (!made.empty() && made[f] == 0)) again.add(static_cast<Index>(f));
  std::vector<char> keep = again.close();
  for (char& k : keep) k = static_cast<char>(k == 0);
  return keep;
}

#define ESPALIER_INSTANTIATE(T)                                                                                    \
  template std::vector<char> fronts_to_keep(const NumericState<T>&, const plan::Plan&, const plan::FrontsBefore&); \
  template std::vector<char> changed_fronts(const NumericState<T>&, std::span<const T>, std::span<const T>,        \
                                            const PivotRule&, base::ThreadPool&);                                  \
  template std::vector<char> unchanged_fronts(const NumericState<T>&, std::span<const T>, std::span<const T>,      \
                                              const PivotRule&, base::ThreadPool&, std::span<const char>);
ESPALIER_FOR_SCALARS(ESPALIER_INSTANTIATE)
#undef ESPALIER_INSTANTIATE

}  // namespace espalier::device::host

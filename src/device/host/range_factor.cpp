#include <algorithm>
#include <cstring>

#include "device/host/assembly.hpp"
#include "device/host/halting.hpp"
#include "device/host/pivoting.hpp"
#include "device/host/tile_factor.hpp"

namespace espalier::device::host {

namespace {

using plan::FrontLayout;
using plan::Task;

// One whole small front: assembled, eliminated and left in column-major scratch of m columns.
template <class T>
class WholeFront {
 public:
  WholeFront(NumericState<T>& state, Workspace<T>& work, Index f)
      : s_(state),
        w_(work),
        plan_(state.plan),
        f_(f),
        layout_(plan_.layout[f]),
        m_(layout_.rows),
        k_(layout_.pivots),
        ld_(padded<T>(m_)),
        lu_(state.kind == Kind::lu) {}

  void run() {
    assemble();
    eliminate();
    store_factor();
    leave_contribution();
  }

 private:
  [[nodiscard]] T* contribution(Index f, bool upper) {
    const auto& m = plan_.memory;
    return (m.on_stack[f] != 0 ? w_.stack.data() : s_.places) + (upper ? m.contribution2[f] : m.contribution[f]);
  }

  void assemble() {
    std::memset(static_cast<void*>(w_.c.data()), 0, static_cast<std::size_t>(ld_ * m_) * sizeof(T));
    const Offset tile = plan_.first_tile[f_];
    const std::span<const plan::EntryPlace> entries(
        plan_.entries.data() + plan_.entry_ptr[tile],
        static_cast<std::size_t>(plan_.entry_ptr[plan_.first_tile[f_ + 1]] - plan_.entry_ptr[tile]));
    add_entries(entries, s_.values, w_.c.data(), ld_, EntryPart::square);
    const FrontBlock<T> all{w_.c.data(), ld_, 0, m_, 0, m_};
    for (Offset c = plan_.child_ptr[f_]; c < plan_.child_ptr[f_ + 1]; ++c) {
      const Index child = plan_.children[c];
      if (plan_.memory.on_stack[child] == 0) wait_for_contribution(child);
      add_contribution(plan_, child, contribution(child, false), all, false, w_.runs);
      if (lu_) add_contribution(plan_, child, contribution(child, true), all, true, w_.runs);
    }
  }

  // All of it: of another rank's child only its tiles are known.
  void wait_for_contribution(Index child) {
    const FrontLayout& l = plan_.layout[child];
    if (plan_.whole[child] != 0) return s_.front_done.wait(child, s_.abort, &w_.waited_seconds);
    for (Index j = l.pivot_tiles; j < l.tiles; ++j)
      for (Index i = j; i < l.tiles; ++i)
        s_.tile_done.wait(plan_.first_tile[child] + l.tile_index(i, j), s_.abort, &w_.waited_seconds);
  }

  void eliminate() {
    T* c = w_.c.data();
    const Index at = plan_.tree.first[f_];
    const PivotBlock block{f_, at, k_, ld_};
    const auto zero = zero_pivot<T>(s_.rule);
    char* replaced = w_.marks.data();
    if (s_.kind == Kind::llt) {
      const auto good = static_cast<Index>(s_.dense.partial_potrf(m_, k_, c, ld_));
      if (good < k_) s_.fronts[f_].not_positive = at + good;
      book_pivots(s_, w_, block, PivotCounts{}, nullptr);
      return;
    }
    std::int32_t* perm = s_.pivot_order.data() + at;
    const PivotCounts counts =
        s_.kind == Kind::ldlt
            ? s_.dense.partial_ldlt(m_, k_, c, ld_, zero, perm, w_.column.data(), w_.column.data() + k_, replaced)
            : s_.dense.partial_getrf(m_, k_, c, ld_, zero, perm, replaced);
    book_pivots(s_, w_, block, counts, replaced);
    mark_rows_inside(s_, w_, block, m_);
  }

  void store_factor() {
    T* c = w_.c.data();
    T* l = s_.factor(f_);
    const Offset below = layout_.tiles > layout_.pivot_tiles ? layout_.tile_offset(1, 0) : 0;
    s_.dense.invert_lower(k_, c, ld_, s_.kind != Kind::llt, l);
    if (m_ > k_) s_.dense.pack(m_ - k_, k_, c + k_, ld_, l + below);
    if (lu_) {
      T* u = s_.factor2(f_);
      s_.dense.invert_upper_transposed(k_, c, ld_, u);
      if (m_ > k_) s_.dense.pack_transposed(k_, m_ - k_, c + k_ * ld_, ld_, u + below);
    }
    if (s_.kind == Kind::llt || m_ == k_) return;
    std::fill_n(w_.growth(), k_, RealOf<T>(0));
    if (const Index border = plan_.tree.border_rows(f_); border > 0)
      add_growth(s_, m_ - k_ - border, k_, l + below, w_.growth());
    else
      s_.dense.column_max(m_ - k_, k_, l + below, w_.growth());
    mark_growth(s_, plan_.tree.first[f_], k_, w_.growth());
  }

  void leave_contribution() {
    if (m_ == k_) return;
    const Index below = m_ - k_;
    T* lower = contribution(f_, false);
    T* upper = lu_ ? contribution(f_, true) : nullptr;
    const Offset ld = layout_.contribution_ld(0);
    for (Index c = 0; c < below; ++c) {
      const T* column = w_.c.data() + (k_ + c) * ld_ + k_;
      std::copy(column + c, column + below, lower + c * ld + c);
      if (lu_)
        for (Index r = c + 1; r < below; ++r) upper[c * ld + r] = w_.c[(k_ + r) * ld_ + k_ + c];
    }
  }

  NumericState<T>& s_;
  Workspace<T>& w_;
  const plan::Plan& plan_;
  Index f_;
  const FrontLayout& layout_;
  Index m_, k_;
  Offset ld_;
  bool lu_;
};

}  // namespace

template <class T>
void eliminate_range(NumericState<T>& state, Workspace<T>& work, const Task& task) {
  const auto& m = state.plan.memory;
  double* waited = &work.waited_seconds;
  const bool free = !state.halting || memory_is_free(state, task.front, waited);
  for (Offset q = m.wait_ptr[task.front]; q < m.wait_ptr[task.front + 1]; ++q)
    state.front_done.wait(m.wait_fronts[q], state.abort, waited);
  for (Index f = task.begin; f <= task.front; ++f) {
    if (state.is_kept(f)) continue;
    if (state.halting && (!free || !children_are_good(state, f, waited))) {
      state.verdict.set(f, kVerdictHalted);
    } else {
      WholeFront<T>(state, work, f).run();
      if (state.halting) judge_front(state, f);
    }
    state.front_done.set(f);
  }
}

#define ESPALIER_INSTANTIATE(T) template void eliminate_range(NumericState<T>&, Workspace<T>&, const Task&);
ESPALIER_FOR_SCALARS(ESPALIER_INSTANTIATE)
#undef ESPALIER_INSTANTIATE

}  // namespace espalier::device::host

#include "device/host/outcome.hpp"

#include <algorithm>

namespace espalier::device::host {

namespace {

template <class T>
void note_kept(NumericState<T>& state, Index f) {
  for (Offset tile = state.plan.first_tile[f]; tile < state.plan.first_tile[f + 1]; ++tile) state.tile_done.set(tile);
  state.front_done.set(f);
  state.verdict.set(f, kVerdictGood);
}

}  // namespace

template <class T>
void reset_state(NumericState<T>& state, std::span<const T> values) {
  state.values = values;
  state.abort = false;
  state.tile_done.reset();
  state.front_done.reset();
  state.verdict.reset();
  if (state.kept.empty()) std::fill(state.begun.begin(), state.begun.end(), 0);
  for (Index f = 0; f < state.plan.fronts(); ++f) {
    if (state.is_kept(f)) {
      note_kept(state, f);
      continue;
    }
    const plan::FrontLayout& l = state.plan.layout[f];
    std::fill(state.column_state.begin() + state.plan.tree.first[f],
              state.column_state.begin() + state.plan.tree.first[f + 1], kColumnFine);
    state.fronts[f] = FrontOutcome{};
    const Offset below = l.tiles_below();
    state.open_tiles[f].store(static_cast<Index>(l.tile_count()), std::memory_order_relaxed);
    state.open_pivot_tiles[f].store(static_cast<Index>(l.tile_count() - below * (below + 1) / 2),
                                    std::memory_order_relaxed);
  }
}

template <class T>
FactorOutcome summarize(const NumericState<T>& state, const std::vector<Workspace<T>>& work) {
  FactorOutcome out;
  Determinant determinant;
  for (const FrontOutcome& f : state.fronts) {
    if (f.not_positive >= 0 && (out.not_positive < 0 || f.not_positive < out.not_positive))
      out.not_positive = f.not_positive;
    out.negative += f.negative;
    out.two_by_two += f.two_by_two;
    out.small_negative += f.small_negative;
    determinant.multiply(f.determinant);
  }
  out.determinant_sign = determinant.sign();
  out.determinant_log = determinant.log();
  out.determinant_phase = determinant.sign() * determinant.phase();
  for (Index p = 0; p < state.plan.tree.n; ++p) {
    const char s = state.column_state[at(p)];
    if ((s & kColumnReplaced) != 0) out.replaced.push_back(p);
    if ((s & kColumnSmall) != 0) out.small.push_back(p);
    if ((s & kRowReplaced) != 0) out.replaced_rows.push_back(p);
    if ((s & kColumnFailed) != 0) out.failed.push_back(p);
  }
  for (Index f = 0; f < state.plan.fronts() && !out.halted; ++f) out.halted = state.verdict.value(f) == kVerdictHalted;
  for (const auto& w : work) {
    out.busy_seconds += (w.task_seconds - w.waited_seconds) / static_cast<double>(work.size());
    out.waiting_seconds += w.waited_seconds / static_cast<double>(work.size());
  }
  return out;
}

#define ESPALIER_INSTANTIATE(T)                                    \
  template void reset_state(NumericState<T>&, std::span<const T>); \
  template FactorOutcome summarize(const NumericState<T>&, const std::vector<Workspace<T>>&);
ESPALIER_FOR_SCALARS(ESPALIER_INSTANTIATE)
#undef ESPALIER_INSTANTIATE

}  // namespace espalier::device::host

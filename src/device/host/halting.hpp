/// \file
/// Factorizations that end where pivots fail, and go on in a changed plan with what was made.
#pragma once

#include <vector>

#include "device/host/numeric_state.hpp"

namespace espalier::device::host {

/// The contributions of made fronts to parents that were not made.
template <class T>
class LeftInArena final : public LeftContributions<WideOf<T>> {
 public:
  explicit LeftInArena(const NumericState<T>& state) : s_(state) {}
  [[nodiscard]] bool has(Index f) const override;
  void copy(Index f, WideOf<T>* to) const override;

 private:
  const NumericState<T>& s_;
};

/// Whether a task of front f, or of a range that ends with it, may begin: its children's pivots (unless it is a range,
/// whose fronts ask for themselves) and the fronts whose memory it takes over must be good. Waits for their verdicts.
/// All tasks of a front get the same answer, whoever does them and when.
template <class T>
bool memory_is_free(const NumericState<T>& s, Index f, double* waited);
template <class T>
bool children_are_good(const NumericState<T>& s, Index f, double* waited);

/// The verdict over a front all of whose pivot columns are made.
template <class T>
void judge_front(NumericState<T>& s, Index f);

/// Which fronts of the changed plan, by front, have written to the memory that they take over from others.
template <class T>
std::vector<char> fronts_begun(const NumericState<T>& s, const plan::Plan& changed, const plan::FrontsBefore& before);

}  // namespace espalier::device::host

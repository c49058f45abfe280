/// \file
/// Which fronts a factorization need not make again, since what an earlier one has left of them is right.
#pragma once

#include <span>
#include <vector>

#include "base/thread_pool.hpp"
#include "device/host/numeric_state.hpp"

namespace espalier::device::host {

/// What is kept is so for one factorization, however it ends.
template <class T>
struct KeptOnce {
  NumericState<T>& state;
  ~KeptOnce() { state.kept.clear(); }
};

/// Whether a front has been made, in the last factorization or in an earlier one of the same values.
template <class T>
bool was_begun(const NumericState<T>& s, Index f) {
  const auto at = static_cast<std::size_t>(f);
  const std::uint8_t verdict = s.verdict.value(f);
  return s.begun[at] != 0 || verdict == kVerdictGood || verdict == kVerdictFailed;
}

/// After a halted factorization: which fronts of the changed plan need not be made again, by front. Beyond those that
/// were not made or have changed, all above them must be, and where the contributions that they need have lost their
/// places to others, those that made them, and the others.
template <class T>
std::vector<char> fronts_to_keep(const NumericState<T>& s, const plan::Plan& changed, const plan::FrontsBefore& before);

/// After a factorization of all fronts: those with entries that differ, or with pivots that another rule might judge
/// otherwise, by front. Nothing above them is marked for it.
/// @param values, before  of the plan's entries; compared bit by bit
/// @param rule  of the factorization to come; s.rule is that of the last one
template <class T>
std::vector<char> changed_fronts(const NumericState<T>& s, std::span<const T> values, std::span<const T> before,
                                 const PivotRule& rule, base::ThreadPool& pool);

/// Which fronts other values leave as they are, to the last bit, under another rule. The others are
/// changed_fronts(), all above them, and what has to be made for these again as in fronts_to_keep(). Where the plan
/// keeps contributions (PlanOptions::keep_contributions) that is hardly anything.
/// @param made  fronts that have been made, where not all have: in a changed pattern. Empty: all
template <class T>
std::vector<char> unchanged_fronts(const NumericState<T>& s, std::span<const T> values, std::span<const T> before,
                                   const PivotRule& rule, base::ThreadPool& pool, std::span<const char> made = {});

}  // namespace espalier::device::host

/// \file
/// Which fronts a factorization need not make again, since what an earlier one has left of them is right.
#pragma once

#include <span>
#include <vector>

#include "base/thread_pool.hpp"
#include "device/host/numeric_state.hpp"

namespace espalier::device::host {

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

/// After a factorization of all fronts: which of them other values leave as they are, to the last bit, under another
/// rule. The others are those with entries that differ, or with pivots that the rule might judge otherwise, all above
/// them, and what has to be made for these again as in fronts_to_keep(). Where the plan keeps contributions
/// (PlanOptions::keep_contributions) that is hardly anything.
/// @param values, before  of the plan's entries; compared bit by bit
/// @param rule  of the factorization to come; s.rule is that of the last one
template <class T>
std::vector<char> unchanged_fronts(const NumericState<T>& s, std::span<const T> values, std::span<const T> before,
                                   const PivotRule& rule, base::ThreadPool& pool);

}  // namespace espalier::device::host

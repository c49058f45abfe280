/// \file
/// Beginning and end of a factorization on the host.
#pragma once

#include "device/host/numeric_state.hpp"

namespace espalier::device::host {

/// Nothing is done yet.
template <class T>
void reset_state(NumericState<T>& state, std::span<const T> values);

/// What the fronts and workers came to; `seconds` is left out.
template <class T>
FactorOutcome summarize(const NumericState<T>& state, const std::vector<Workspace<T>>& work);

}  // namespace espalier::device::host

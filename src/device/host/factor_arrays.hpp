/// \file
/// All arrays of a factor on the host, one after another, for files.
#pragma once

#include <cstdint>

#include "device/executor.hpp"
#include "device/host/numeric_state.hpp"

namespace espalier::device::host {

/// A number that differs for plans whose factors have arrays of another layout.
template <class T>
std::uint64_t layout_of_arrays(const NumericState<T>& state);
/// Hands out the arrays, in an order that depends on the plan alone.
template <class T>
void visit_arrays(NumericState<T>& state, const ArrayVisit& visit);
/// That a solve with what the arrays hold stays in its bounds. @throws Error(invalid_input)
template <class T>
void expect_factor(const NumericState<T>& state);

}  // namespace espalier::device::host

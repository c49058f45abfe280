/// \file
/// Entries of the inverse of a factored matrix, front by front from the roots down.
#pragma once

#include "base/thread_pool.hpp"
#include "device/host/numeric_state.hpp"

namespace espalier::device::host {

/// See Executor::invert_at(). Only fronts with entries that are asked for, and those above them, are made. The inverse
/// of a front lives until those below have taken their part of it: what is held at a time are the fronts on the way
/// from a root, never the inverse on the whole pattern of the factor.
/// @pre the factors of all fronts are in their places
/// @throws Error(out_of_memory)
template <class T>
void invert_at(NumericState<T>& state, base::ThreadPool& pool, base::MemoryBudget* budget,
               const InverseEntries<T>& entries);

}  // namespace espalier::device::host

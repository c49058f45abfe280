/// \file
/// The numeric tasks of the host executor: one tile of a front, or a range of whole small fronts.
#pragma once

#include "device/host/numeric_state.hpp"

namespace espalier::device::host {

/// Makes the tile of a tile task: assembly, products with finished tiles, then factor, solve, or contribution.
/// Waits for what it needs. @throws Aborted
template <class T>
void make_tile(NumericState<T>& state, Workspace<T>& work, const plan::Task& task);

/// Eliminates the fronts of a range task one after another. Waits for the children of its first level. @throws Aborted
template <class T>
void eliminate_range(NumericState<T>& state, Workspace<T>& work, const plan::Task& task);

}  // namespace espalier::device::host

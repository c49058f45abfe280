/// \file
/// The textbook's multifrontal method, serial and slow: dense fronts, no tiles, pivots chosen inside a whole front
/// (Duff and Reid 1983). What other backends compute is compared with it.
#pragma once

#include <memory>

#include "device/backend.hpp"

namespace espalier::device::reference {

/// @param job  of a plan for one device, of any layout: only its tree and its entries matter
/// @throws Error(invalid_input) for a plan of several devices; Error(out_of_memory)
template <class T>
std::unique_ptr<Executor<T>> make_reference_executor(const Job& job);

}  // namespace espalier::device::reference

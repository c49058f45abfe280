/// \file
/// From the chosen device to its executor: in core where the device's memory suffices, streaming where it does not.
#pragma once

#include <memory>

#include "base/timeline.hpp"
#include "device/executor.hpp"
#include "solver/numeric.hpp"

namespace espalier::solver {

/// @throws Error(out_of_memory) naming the least budget that works, where options give less
template <class T>
std::unique_ptr<device::Executor<T>> make_executor(const plan::Plan& plan, const NumericOptions& options,
                                                   const device::PivotRule& rule, base::ThreadPool& pool,
                                                   base::MemoryBudget& budget, base::Timeline* timeline);

}  // namespace espalier::solver

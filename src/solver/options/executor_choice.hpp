/// \file
/// From an analysis to an executor of its backend: in core where the devices' memory suffices, out of core where it
/// does not.
#pragma once

#include <memory>

#include "device/executor.hpp"
#include "solver/analysis/analysis.hpp"
#include "solver/session/context.hpp"

namespace espalier::solver {

/// @throws Error(out_of_memory) naming the least budget that works, where options give less
template <class T>
std::unique_ptr<device::Executor<T>> make_executor(const Analysis& analysis, const device::PivotRule& rule,
                                                   const Context& context);

/// Bytes of factor and work arrays that make_executor() takes of the host's budget, with a solution for one right-hand
/// side; of devices with memory of their own, of theirs. What does not fit budgets of host devices is planned out of
/// core to know it.
Offset predicted_executor_bytes(const Analysis& analysis, const Context& context);

/// What of a factor would go to Options::scratch.
struct DiskForecast {
  Offset file_bytes = 0;                     ///< at most; 0: all of it fits in memory
  Offset written_bytes = 0, read_bytes = 0;  ///< by a factorization
  Offset way_read_bytes = 0;                 ///< by one way of a solve
};
/// The forecast of host devices whose budget leaves so much for the factor; others tell nothing.
/// @throws Error(out_of_memory) as make_executor() would
DiskForecast predict_disk(const Analysis& analysis, const Context& context, Offset left_bytes);
/// About the least budget of the host with which make_executor() puts a factor of host devices on disk; it does.
Offset least_budget_on_disk(const Analysis& analysis, const Context& context);

}  // namespace espalier::solver

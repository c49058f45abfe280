/// \file
/// A factorization that one rank carries out for all.
#pragma once

#include <functional>
#include <memory>

#include "device/executor.hpp"
#include "solver/session/context.hpp"

namespace espalier::solver {

/// An executor that the first rank makes and keeps; the others get what it comes to: outcomes, reports, solutions. All
/// calls are collective, with the same values and right-hand sides on all ranks.
/// @param make  called on the first rank, on a thread of its own (ranks/first_rank.hpp), with the threads that are the
///        executor's as long as it lives
/// @param context  outlives the executor; there are ranks
/// @throws Error on all ranks: what make() throws
template <class T>
std::unique_ptr<device::Executor<T>> make_first_rank_executor(
    const std::function<std::unique_ptr<device::Executor<T>>(base::ThreadPool& pool)>& make, Index unknowns,
    const Context& context);

}  // namespace espalier::solver

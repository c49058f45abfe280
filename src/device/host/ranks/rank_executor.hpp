/// \file
/// The host backend in one of several processes that share a plan: a rank.
#pragma once

#include <memory>

#include "device/backend.hpp"

namespace espalier::device::host {

/// Carries out this rank's part of a plan for Job::link's ranks (plan/rank_parts.hpp) on the threads of the pool. The
/// thread that calls drives the messages: between its tasks, in its waits, and to the end.
///
/// All calls are collective, with the same arguments on every rank. Every rank gets the same outcome, and solve() the
/// whole solution. The numbers are those of one process, to the last bit: a tile is made by one task from exact copies.
///
/// @throws Error on all ranks when one of them lacks memory, fails, is lost, or has come to another plan
template <class T>
std::unique_ptr<Executor<T>> make_rank_executor(const Job& job);

}  // namespace espalier::device::host

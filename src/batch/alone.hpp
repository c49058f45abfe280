/// \file
/// A system by itself, and what becomes of all.
#pragma once

#include <functional>
#include <span>

#include "batch/chunk.hpp"
#include "espalier/batch.hpp"
#include "solver/session/session.hpp"

namespace espalier::batch {

/// What to do where memory is short.
inline constexpr const char* kRemedy = "use fewer threads or a machine with more memory";

/// Factorizes and solves; what fails is a status. @pre session.factor
SystemResult solve_one(solver::Session& session, const ChunkSystem& system, Index columns, bool transpose);
/// The same from the beginning, in a session of its own.
SystemResult solve_alone(const System& system, const Options& options);
/// Systems of these numbers, so many at a time. @returns how many at a time
int solve_on_threads(solver::Session& session, std::span<const System> systems, std::span<const Index> numbers,
                     int workers, std::span<SystemResult> results);
/// @throws Error(invalid_input) for a pattern without values
void expect_values(const MatrixView& a);
/// x of a system that has failed.
void forget_solution(std::span<double> x);
/// What `work` makes of the systems: what it throws, or else the failures that it has left there, as the status of all.
/// @param start  of base::now_seconds()
BatchResult carry_out(solver::Session& session, double start, const std::function<void(BatchResult&)>& work);

}  // namespace espalier::batch

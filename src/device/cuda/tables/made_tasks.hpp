/// \file
/// The tasks of some fronts alone: of a factorization that makes only these again, and finds the others as the one
/// before has left them.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "device/cuda/tables/device_plan.hpp"

namespace espalier::device::cuda {

struct MadeTasks {
  std::vector<FactorTask> tasks;    ///< in the order of TaskLists::tasks
  std::int64_t narrow_tasks = 0;    ///< as in TaskLists
  std::vector<SolveTask> inverses;  ///< likewise
};

/// @param made  fronts; not 0: it is made
MadeTasks tasks_of(const TaskLists& all, std::span<const char> made);

}  // namespace espalier::device::cuda

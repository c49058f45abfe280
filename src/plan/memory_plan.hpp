/// \file
/// Planning of memory, as far as parts of a plan need it.
#pragma once

#include <vector>

#include "plan/plan.hpp"

namespace espalier::plan {

/// Tasks of a list that is not there as a whole.
struct NumberedTasks {
  std::vector<Index> numbers;  ///< of plan.tasks in the whole list, ascending
  Index all = 0;               ///< length of the whole list
};

/// As plan_memory() for one device, where plan.tasks has only those with which fronts begin and end; plan.first_task
/// and plan.last_task count in the whole list.
void plan_memory(Plan& plan, const ArraySizes& sizes, const NumberedTasks& tasks);

/// Memory of the regions that `sizes` names, each for itself: places count from its start, and what a front passes on
/// to another region stays.
/// @param threads  that may be started, one a region
MemoryPlan plan_regions(const Plan& plan, const ArraySizes& sizes, int threads);

}  // namespace espalier::plan

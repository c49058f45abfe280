/// \file
/// Planning of memory, as far as parts of a plan need it.
#pragma once

#include <algorithm>
#include <vector>

#include "plan/plan.hpp"

namespace espalier::plan {

/// Tasks of a list that is not there as a whole.
struct NumberedTasks {
  std::vector<Index> numbers;  ///< of plan.tasks in the whole list, ascending
  Index all = 0;               ///< length of the whole list
};

/// Contributions inside a range task, on the stack of whoever takes it: fills m.on_stack, m.contribution and
/// m.stack_size. @param entries  of the contribution of a front, of its lower part
template <class Entries>
void place_on_stack(const Plan& plan, const Task& range, MemoryPlan& m, Entries&& entries) {
  Offset top = 0;
  const Offset copies = plan.options.unsymmetric ? 2 : 1;
  for (Index f = range.begin; f < range.front; ++f) {
    for (Offset c = plan.child_ptr[f]; c < plan.child_ptr[f + 1]; ++c) top -= copies * entries(plan.children[c]);
    m.on_stack[f] = 1;
    m.contribution[f] = top;
    if (copies == 2) m.contribution2[f] = top + entries(f);
    top += copies * entries(f);
    m.stack_size = std::max(m.stack_size, top);
  }
}

/// As plan_memory() for one device, where plan.tasks has only those with which fronts begin and end; plan.first_task
/// and plan.last_task count in the whole list.
void plan_memory(Plan& plan, const ArraySizes& sizes, const NumberedTasks& tasks);

/// Memory of the regions that `sizes` names, each for itself: places count from its start, and what a front passes on
/// to another region stays.
/// @param threads  that may be started, one a region
MemoryPlan plan_regions(const Plan& plan, const ArraySizes& sizes, int threads);

}  // namespace espalier::plan

/// \file
/// The order of work: depth-first over groups of sub-trees, tier by tier inside a group. With several devices: one such
/// walk for each sub-tree that one device has, then the top of the tree tier by tier.
#pragma once

#include "plan/plan.hpp"

namespace espalier::plan {

/// Fills plan.tasks, plan.first_task and plan.last_task, and the places of the sub-trees of plan.ownership in the
/// list. Of several ranks, the tasks of the plan's rank alone.
/// @pre layout, whole, children, tier and ownership are set
/// @param pool  may be null
void list_tasks(Plan& plan, base::ThreadPool* pool = nullptr);

}  // namespace espalier::plan

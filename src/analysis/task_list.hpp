/// \file
/// The order of work: depth-first over groups of sub-trees, tier by tier inside a group.
#pragma once

#include "analysis/plan.hpp"

namespace espalier::analysis {

/// Fills plan.tasks, plan.first_task and plan.last_task. @pre layout, whole, children and tier are set.
void list_tasks(Plan& plan);

}  // namespace espalier::analysis

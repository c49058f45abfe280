/// \file
/// What out-of-core plans do with the host's store.
#pragma once

#include <vector>

#include "out_of_core/disk_store.hpp"
#include "out_of_core/partial_run.hpp"

namespace espalier::out_of_core {

/// Arrays that an operation copies; in-core steps store both factor arrays as one.
int parts_of(const Operation& op);

/// Steps that the longest list of operations takes.
Index steps_of(const std::vector<OutOfCorePlan>& plans);

/// The step of an operation. Those of several devices have no common numbers: as if all lists took as many steps.
Index step_of(const OutOfCorePlan& plan, const Operation* op, Index steps);

/// The uses of a store by these plans, by rising steps, so many in all.
std::vector<StoreUse> store_uses(const std::vector<OutOfCorePlan>& plans, const OutOfCoreLayout& layout, Index steps,
                                 const PartialRun& part = {});

}  // namespace espalier::out_of_core

/// \file
/// Cutting a tree into the units of an out-of-core plan.
#pragma once

#include <vector>

#include "base/thread_pool.hpp"
#include "out_of_core/plan.hpp"
#include "out_of_core/share.hpp"

namespace espalier::out_of_core {

/// An in-core step, or a large front (`fronts` empty).
struct Unit {
  std::vector<Index> fronts;  ///< ascending
  Index large = -1;
  std::vector<Index> devices;  ///< that work on it, ascending; one for a step
};

/// How a tree is cut.
struct TreeCut {
  std::vector<Offset> limit_bytes;  ///< devices; of an in-core step, about
  DeviceSets sets;                  ///< fronts; see share_fronts()
  double share_seconds = 0;         ///< see PlanningRates
};

/// Units in topological order, each in-core step within its device's limit as far as fronts allow. A front of several
/// devices that is no large front is done by the one with the highest limit.
std::vector<Unit> cut_into_units(const OutOfCoreLayout& layout, const TreeCut& cut);

/// Which tasks of OutOfCoreLayout::order() begin or end a front: all that memory depends on. Found once for all cuts of
/// a tree, which read it instead of the tasks.
struct TaskMarks {
  explicit TaskMarks(const OutOfCoreLayout& layout);
  std::vector<Index> front;          ///< tasks
  std::vector<char> begins_or_ends;  ///< tasks
};

/// The in-core steps of these units (empty for large fronts): externals, places of their arrays. Without their tasks.
/// @param pool  null: the calling thread alone
std::vector<InCoreStep> make_in_core_steps(const OutOfCoreLayout& layout, const std::vector<Unit>& units,
                                           const TaskMarks& marks, base::ThreadPool* pool);
/// Gives the steps of the plans that were chosen their tasks, in the order of the layout.
void give_tasks(const OutOfCoreLayout& layout, std::vector<OutOfCorePlan>& plans);

/// Calls use(unit) for all units, by all threads.
template <class Use>
void for_each_unit(std::size_t units, base::ThreadPool* pool, Use&& use) {
  if (pool != nullptr)
    pool->for_each(static_cast<std::int64_t>(units), [&](std::int64_t u) { use(at(u)); });
  else
    for (std::size_t u = 0; u < units; ++u) use(u);
}

}  // namespace espalier::out_of_core

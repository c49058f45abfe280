/// \file
/// A plan that follows its tree when pivots move: most of it stays, places in memory above all, so that the factors of
/// fronts that stay need not be made again.
#pragma once

#include <optional>
#include <vector>

#include "base/thread_pool.hpp"
#include "matrix/row_index.hpp"
#include "plan/plan.hpp"

namespace espalier::plan {

/// Elements that an arena for this plan should have, so that changed plans can go on in it: those behind the plan's own
/// are the machine's only once they are used.
Offset elements_with_room(const MemoryPlan& memory);

/// Which front of a changed plan was which before; by front now. See fronts_that_stay() for changed patterns.
struct FrontsBefore {
  std::vector<Index> front;  ///< ascending; what has vanished is not among them
  /// Fronts of before in the same way, where the front has the same columns, rows, tiles, tasks and places in memory.
  /// -1: it is another one; its arrays may lie elsewhere.
  std::vector<Index> same;
  /// It is the pattern that has changed: the next values are others as well, and `front` is empty.
  bool of_pattern = false;
};

struct ChangedPlan {
  Plan plan;
  FrontsBefore before;
};

/// The plan of a tree in which pivots have moved to later fronts. A front that changes keeps its place in the order of
/// work. Its arrays stay where they are if they fit there, or go behind the end of the memory.
/// @param tree  of relocate_pivots() with the tree of `before`
/// @param front_before  what relocate_pivots() returned: by front of the tree
/// @param rows  index of `a`
/// @returns nothing where a plan that is made anew is better or the only one: several devices, backends with arrays of
///          their own (PlanOptions::arrays), fronts that outgrow a range task, no more room (elements_with_room())
std::optional<ChangedPlan> change_plan(const Plan& before, analysis::AssemblyTree tree, std::vector<Index> front_before,
                                       const MatrixView& a, const std::vector<Index>& row_of_col,
                                       const matrix::RowIndex& rows, base::ThreadPool& pool);

}  // namespace espalier::plan

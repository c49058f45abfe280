/// \file
/// Which device of several does which part of a plan: sub-trees to one device each, the top of the tree to all.
#pragma once

#include <bit>
#include <cstdint>
#include <vector>

#include "espalier/types.hpp"
#include "plan/front_cost.hpp"

namespace espalier::plan {

struct Plan;

/// A set of neighbouring sub-trees that one device works on as a whole: what is assigned, and what is stolen.
struct SubTree {
  std::vector<Index> roots;  ///< fronts, ascending
  Index device = 0;          ///< whose it is, unless another device steals it
  bool apart = true;   ///< stands alone in the list, so that it can be stolen; else together with others of its device
  double seconds = 0;  ///< predicted time on one worker
  Index first_task = 0;  ///< its tasks are first_task .. end_task - 1 of the plan's list
  Index end_task = 0;
};

/// The cut of a tree over devices. With one device there are no sub-trees, and everything is the top.
///
/// The plan's task list holds the sub-trees one after another (by device, a device's largest first), then the top tier
/// by tier. Executors keep to these rules, by which no run can deadlock, whatever is stolen:
///  1. every task waits only for tasks earlier in the list (its operands, and the users of memory that it reuses);
///  2. a device opens one sub-tree at a time, its own in the order of the list, and hands out the tasks of what is open
///     in that order to its workers; after its sub-trees it does its tasks of the top, in that order;
///  3. a stolen sub-tree is one that nobody has opened, taken by a device with no unopened one of its own that has not
///     begun its top.
/// For let t be the first task of the list that is not finished, in a state where every worker waits or has stopped.
/// Nothing that t needs is missing (rule 1), so t has not been handed out. If its sub-tree is unopened, its owner's
/// workers hold tasks of sub-trees that stand before it (2, 3): all finished, so they are free to open it. If it is
/// open, the worker that opened it has since taken only tasks of it before t: finished, so it takes t. If t belongs to
/// the top, all sub-trees are finished, and so are the tasks before t that its owner's workers took: they take t.
struct Ownership {
  static constexpr Index kMostMembers = 64;  ///< with more devices, all share all of the top

  Index devices = 1;
  Index column_group = 1;         ///< at most so many neighbouring block columns of the top are dealt together
  bool stealing = true;           ///< rule 3 is in force; without it every sub-tree stays with its device
  bool shared_top = true;         ///< else device 0 does all of the top
  std::vector<SubTree> subtrees;  ///< by device, then falling `seconds`
  std::vector<Index> subtree_of;  ///< fronts; -1: the top. Empty with one device
  Index top_task = 0;             ///< number of the first task of the top
  /// Owners of the block columns of the top where they are dealt by load: fronts + 1 places in `owners`. Else empty.
  std::vector<Offset> owner_ptr;
  std::vector<std::uint8_t> owners;
  std::vector<std::uint64_t> members;  ///< fronts; bit d: device d has its factor. Empty with one device, or too many

  /// The sub-tree of a front, -1: the top.
  [[nodiscard]] Index subtree(Index front) const { return subtree_of.empty() ? -1 : subtree_of[at(front)]; }
  /// The device that makes the tiles of column `column` of a front, unless a thief does: block columns of the top are
  /// dealt cyclically to the devices that have a sub-tree below the front, beginning with another one for every front
  /// (with shared_top).
  [[nodiscard]] Index owner(Index front, Index column) const {
    const Index s = subtree(front);
    if (s >= 0) return subtrees[at(s)].device;
    if (!shared_top) return 0;
    if (!owners.empty()) return owners[static_cast<std::size_t>(owner_ptr[at(front)] + column)];
    const Offset turn = Offset{column} / column_group + front;
    if (members.empty()) return static_cast<Index>(turn % devices);
    std::uint64_t set = members[at(front)];
    for (auto k = turn % std::popcount(set); k > 0; --k) set &= set - 1;
    return std::countr_zero(set);
  }
};

/// Cuts the plan's tree for plan.options.devices: the most expensive sub-tree gives its root to the top until none
/// takes more than the share of 1 / (devices (1 + additional_subtrees)) of all time; neighbouring small ones are put
/// together; then the largest goes first to the device with the least to do (Graham's LPT rule, 1969).
/// @pre tree, options, layout and children are set
Ownership assign_owners(const Plan& plan);

}  // namespace espalier::plan

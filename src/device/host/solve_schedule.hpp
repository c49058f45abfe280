/// \file
/// The tasks of a substitution on the host, and where what fronts hand to their parents stands meanwhile.
#pragma once

#include <span>
#include <vector>

#include "plan/plan.hpp"

namespace espalier::device::host {

/// A sub-tree of at most so many entries of the factor is one task: half a megabyte is some 30 microseconds of memory
/// traffic, a hundred times what handing out a task costs.
inline constexpr Offset kSolveTaskEntries = 1 << 16;

/// One unit of work of a substitution: a range of fronts (begin .. front, a sub-tree), one front (begin == front), or
/// one tile row (forward) or tile column (backward) of a front (tile >= 0).
struct SolveTask {
  Index front;
  Index begin;
  Index tile;
};

/// The share of a solve that several ranks share. A rank takes its sub-trees, and all of the top above them, as others
/// do who have sub-trees there: the same numbers everywhere.
class SolveShare {
 public:
  virtual ~SolveShare() = default;
  [[nodiscard]] virtual bool takes(Index front) const = 0;
  /// Whether the front belongs to a sub-tree of this rank alone.
  [[nodiscard]] virtual bool is_alone(Index front) const = 0;
};

/// Made once for a plan. Contributions stand in rows, each of as many numbers as there are right-hand sides.
class SolveSchedule {
 public:
  /// @param share  null: all fronts are here
  SolveSchedule(const plan::Plan& plan, const SolveShare* share);

  /// Takes fronts in the order in which a store holds them. @param place  of fronts; below 0: in memory
  void follow(std::span<const Offset> place);

  [[nodiscard]] const std::vector<SolveTask>& forward() const { return forward_; }
  [[nodiscard]] const std::vector<SolveTask>& backward() const { return backward_; }
  /// Tile tasks of a front that is split, 1 of others.
  [[nodiscard]] Index tiles(Index front) const { return tiles_[at(front)]; }
  /// The first row of a front's contribution: on the worker's stack where its parent is in the same range of fronts.
  [[nodiscard]] Offset place(Index front) const { return place_[at(front)]; }
  [[nodiscard]] bool on_stack(Index front) const { return on_stack_[at(front)] != 0; }
  [[nodiscard]] Offset contribution_rows() const { return contribution_rows_; }
  [[nodiscard]] Offset stack_rows() const { return stack_rows_; }
  [[nodiscard]] Index largest_front_rows() const { return largest_front_rows_; }  ///< padded
  [[nodiscard]] Index largest_tile() const { return largest_tile_; }              ///< likewise

 private:
  void list_tasks(const SolveShare* share);
  void list_backward();
  void place_contributions();
  void place_others(const SolveShare& share);

  const plan::Plan& plan_;
  std::vector<SolveTask> forward_, backward_;
  std::vector<Index> tiles_;
  std::vector<Offset> place_;
  std::vector<char> on_stack_;
  Offset contribution_rows_ = 0, stack_rows_ = 0;
  Index largest_front_rows_ = 0, largest_tile_ = 0;
};

}  // namespace espalier::device::host

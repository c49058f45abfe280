/// \file
/// The numeric factor on a host device and what its workers share.
#pragma once

#include <atomic>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "base/memory.hpp"
#include "device/determinant.hpp"
#include "device/executor.hpp"
#include "device/host/kernels/kernels.hpp"
#include "device/host/progress.hpp"
#include "plan/changed_plan.hpp"
#include "plan/plan.hpp"

namespace espalier::device::host {

/// Consecutive rows of a child that are consecutive in the parent's part too.
struct Run {
  Index begin;   ///< first row of the child's contribution
  Index end;     ///< one past its last row
  Index target;  ///< row of the part at which `begin` is added
};

/// What is factored. Of real numbers `hermitian` says nothing.
struct MatrixKind {
  Kind kind;
  bool hermitian = false;
};

/// What one front contributes to the outcome; summed in the order of fronts, so that the result does not depend on
/// threads.
struct FrontOutcome {
  Index not_positive = -1;  ///< position; -1: none
  Index negative = 0;
  Index two_by_two = 0;
  Index small_negative = 0;
  double least_pivot = std::numeric_limits<double>::infinity();  ///< ldlt, lu: magnitude; 0: was not looked at
  Determinant determinant;
};

/// Bits of NumericState::column_state.
enum ColumnState : char { kColumnFine = 0, kColumnReplaced = 1, kColumnFailed = 2, kColumnSmall = 4, kRowReplaced = 8 };

/// What came of a front in a factorization that halts at failures; values of NumericState::verdict.
enum Verdict : std::uint8_t {
  kVerdictOpen = 0,
  kVerdictGood = 1,
  kVerdictFailed = 2,  ///< some of its pivots failed: nothing above it is made
  kVerdictHalted = 3,  ///< it was not made
};

/// A front of which only block columns from `first_column` on are made, from what stands in their places; everything to
/// the left of them is accounted for there. Out of core only.
struct FrontWindow {
  Index front = -1;
  Index first_column = 0;
};

/// Arrays of the numeric factor. Diagonal tiles hold inverses: of L_jj (unit for ldlt and lu) in `factor`, of U_jj
/// transposed in `factor2` (lu).
template <class T>
struct NumericState {
  /// @param elements  of the arena; -1: as many as the plan needs
  NumericState(const plan::Plan& the_plan, MatrixKind the_matrix, const PivotRule& the_rule, base::MemoryBudget* budget,
               Offset elements = -1)
      : plan(the_plan),
        kind(the_matrix.kind),
        hermitian(the_matrix.hermitian),
        rule(the_rule),
        dense(kernels<T>(the_matrix.hermitian)),
        arena_share(elements == 0 ? 0 : the_plan.memory.size * static_cast<Offset>(sizeof(T)), budget),
        arena(elements < 0 ? the_plan.memory.size : elements, nullptr),
        places(arena.data()),
        pivot_order(the_matrix.kind == Kind::llt ? 0 : the_plan.tree.n, budget),
        d_inverse(the_matrix.kind == Kind::ldlt ? the_plan.tree.n : 0, budget),
        e_inverse(the_matrix.kind == Kind::ldlt ? the_plan.tree.n : 0, budget),
        column_state(at(the_plan.tree.n), kColumnFine),
        fronts(at(the_plan.fronts())),
        tile_done(the_plan.tiles()),
        front_done(the_plan.fronts()),
        open_tiles(std::make_unique<std::atomic<Index>[]>(at(the_plan.fronts()))),
        verdict(the_plan.fronts()),
        open_pivot_tiles(std::make_unique<std::atomic<Index>[]>(at(the_plan.fronts()))),
        begun(at(the_plan.fronts()), 0) {}
  /// For a changed plan, with what `from` has made of the fronts that are kept: `keep`, by front. Without an arena as
  /// yet.
  NumericState(const plan::Plan& changed, const plan::FrontsBefore& before, std::vector<char> keep,
               const NumericState& from, base::MemoryBudget* budget);
  /// That of `from`, which is left without one. @throws Error(out_of_memory); nothing has changed then
  void take_arena(NumericState& from);

  const plan::Plan& plan;
  Kind kind;
  bool hermitian;
  PivotRule rule;
  const Kernels<T>& dense;
  std::span<const T> values;  ///< of the current factorize() call

  base::BudgetShare arena_share;  ///< of the plan's part of the arena
  base::Buffer<T> arena;          ///< with room for changed plans
  T* places;                      ///< what plan.memory counts from: the arena, or a store of factors
  FrontWindow window;
  base::Buffer<std::int32_t> pivot_order;  ///< n; by position: the row within its tile that the pivoting put there
  base::Buffer<T> d_inverse;               ///< n; diagonal of D^-1 (ldlt)
  base::Buffer<T> e_inverse;               ///< n; subdiagonal of D^-1, nonzero at the first column of a 2x2 pivot
  std::vector<char> column_state;          ///< n; ColumnState bits
  std::vector<FrontOutcome> fronts;

  Progress tile_done;                                ///< by global tile number
  Progress front_done;                               ///< by front
  std::unique_ptr<std::atomic<Index>[]> open_tiles;  ///< by front: tile tasks not yet finished
  bool halting = false;
  /// Where halting: what failed fronts have left must stay, for a plan that goes on with it. Else only what is above
  /// them is not made, so that what fails does not depend on memory.
  bool keeps_what_is_left = true;
  Progress verdict;                                        ///< by front; set where halting
  std::unique_ptr<std::atomic<Index>[]> open_pivot_tiles;  ///< by front: as open_tiles, of pivot columns; where halting
  std::vector<char> begun;  ///< fronts; 1: it was made in an earlier factorization of these values
  std::vector<char> kept;   ///< fronts; 1: the next factorization does not make it again. Empty: makes all
  std::atomic<bool> abort{false};

  [[nodiscard]] T* factor(Index f) { return places + plan.memory.factor[f]; }
  [[nodiscard]] T* factor2(Index f) { return places + plan.memory.factor2[f]; }
  [[nodiscard]] bool is_kept(Index f) const { return !kept.empty() && kept[at(f)] != 0; }
};

/// One worker's own memory.
template <class T>
struct Workspace {
  Workspace(const plan::Plan& plan, Kind kind, base::MemoryBudget* budget);
  [[nodiscard]] Offset bytes() const {
    return c.bytes() + c2.bytes() + panels.bytes() + stack.bytes() + column.bytes() + marks.bytes();
  }

  base::Buffer<T> c;         ///< a tile or a whole small front, column-major
  base::Buffer<T> c2;        ///< the U^T part of a tile (lu); the column-permuted tile (ldlt)
  base::Buffer<T> panels;    ///< a tile in panels
  base::Buffer<T> stack;     ///< contributions inside a range task
  base::Buffer<T> column;    ///< two values per column of a tile: d and e, or growth()
  base::Buffer<char> marks;  ///< one per column of a tile: replaced pivots
  std::vector<Run> runs;     ///< of the child being added
  double waited_seconds = 0;
  double task_seconds = 0;

  /// One magnitude per column of a tile.
  [[nodiscard]] RealOf<T>* growth() { return reinterpret_cast<RealOf<T>*>(column.data()); }
};

}  // namespace espalier::device::host

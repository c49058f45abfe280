/// \file
/// The out-of-core plan: how a factorization runs in a device memory that holds only a part of it. Every place in that
/// memory, every copy and every wait is fixed before the first number; executors carry it out.
///
/// The tree is cut into *units*, taken in topological order:
///  - an *in-core step*: fronts that fit together; what they eliminate goes to the host behind the computation;
///  - a *large front*: too large for that; taken in *groups* of block columns, left-looking. A group is assembled from
///    the entries of A and the children's contributions, block column by block column; the pivot columns of earlier
///    groups come by in slabs; then its own pivots are eliminated.
/// Contributions stay on the device while there is room; when there is not, those go whose use is farthest (Belady
/// 1966).
///
/// One device: the factors of the units that are eliminated last stay where they were made, as many as pay; those need
/// no place in the host's store. A solve does them on the device, and the others on the host or, sub-trees of them,
/// through the link, side by side.
///
/// Several devices have a plan each, over one store in the host's memory: sub-trees stay with one device, the groups of
/// a large front above them are dealt to the devices that have a sub-tree below it, and what one device needs of
/// another goes through the store. All operations of all devices stand in one topological order, of which every queue
/// keeps its part, so that the earliest unfinished operation can always proceed: no wait can deadlock.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "plan/plan.hpp"

namespace espalier::out_of_core {

/// Consecutive elements of an array.
struct Extent {
  Offset at = 0;
  Offset size = 0;
};

struct InCoreStep;

/// What the planner knows of a backend. Offsets and sizes are in elements unless they say bytes.
class OutOfCoreLayout {
 public:
  virtual ~OutOfCoreLayout() = default;
  [[nodiscard]] virtual const plan::Plan& plan() const = 0;
  [[nodiscard]] virtual Offset element_bytes() const = 0;
  /// All tasks, in an order in which any subset of fronts can be carried out.
  [[nodiscard]] virtual const plan::TaskList& order() const = 0;
  [[nodiscard]] virtual const plan::ArraySizes& sizes() const = 0;
  /// Start of pivot block column `column` in the factor array of front f; column == pivot tiles: its size.
  [[nodiscard]] virtual Offset factor_offset(Index f, Index column) const = 0;
  /// Start of block column `column` below (0-based) in the contribution array; column == tiles below: its size.
  [[nodiscard]] virtual Offset contribution_offset(Index f, Index column) const = 0;
  /// Appends the extents of the factor array that hold block columns [begin, end) from block row `row` on.
  virtual void slab(Index f, Index begin, Index end, Index row, std::vector<Extent>& extents) const = 0;
  /// About the bytes of front f's share in the tables of an in-core step, scratch included.
  [[nodiscard]] virtual Offset share_bytes(Index f) const = 0;
  /// Exact bytes of the tables that the device reads, and of its scratch, whose first output_bytes() go to the host.
  /// Both depend on the fronts, not on the places.
  [[nodiscard]] virtual Offset table_bytes(const InCoreStep& step) const = 0;
  [[nodiscard]] virtual Offset scratch_bytes(const InCoreStep& step) const = 0;
  [[nodiscard]] virtual Offset output_bytes(const InCoreStep& step) const = 0;
  [[nodiscard]] virtual Offset table_bytes(Index f, Index begin, Index end) const = 0;
  [[nodiscard]] virtual Offset scratch_bytes(Index f, Index begin, Index end) const = 0;
  [[nodiscard]] virtual Offset output_bytes(Index f, Index begin, Index end) const = 0;
  /// Whether the values of A are copied to the device, in the order of the step's entries.
  [[nodiscard]] virtual bool copies_values() const = 0;
  /// Bytes that a solve for so many right-hand sides takes in the arena, for the tables and vectors of these fronts, if
  /// they are done on the device. @param fronts  ascending; with each all above it
  [[nodiscard]] virtual Offset solve_bytes(const std::vector<Index>& fronts, Index columns) const = 0;
};

/// Fronts that are eliminated together. Places are bytes of the device arena.
struct InCoreStep {
  std::vector<Index> fronts;      ///< ascending
  std::vector<Index> externals;   ///< children of these fronts that were eliminated before, ascending
  std::vector<plan::Task> tasks;  ///< of these fronts
  plan::MemoryPlan memory;        ///< by place in `fronts`; elements from work_at on
  Offset entries = 0;             ///< entries of A
  Offset tables_at = 0, values_at = 0, scratch_at = 0, work_at = 0;
  std::vector<std::array<Offset, 2>> external_at;  ///< contributions of the externals, lower and upper part
  std::vector<std::array<Offset, 2>>
      root_at;          ///< by place in `fronts`: a contribution that outlives the step; -1: none
  Offset store_at = 0;  ///< elements of the host's store: the step's factors, as on the device
};

/// A group of block columns of a large front.
struct ColumnGroup {
  Index front = 0;
  Index begin = 0, end = 0;  ///< block columns; those from pivot_tiles on are contribution
  Offset entries = 0, first_entry = 0;
  Offset tables_at = 0, values_at = 0, scratch_at = 0;
  std::array<Offset, 2> factor_at{};        ///< pivot columns; the second: U^T (lu), L D (ldlt)
  std::array<Offset, 2> contribution_at{};  ///< columns below
};

enum class OperationType : char {
  load_tables,         ///< of step or group
  load_values,         ///< likewise
  load_slab,           ///< pivot columns [begin, end) of `front` from block row `row` on, first part, then second
  load_contribution,   ///< columns [begin, end) below of `front`, lower part, then upper
  eliminate,           ///< an in-core step
  begin_group,         ///< zero, and the entries of A
  add_child,           ///< contribution columns [begin, end) of `front` into the group
  update,              ///< the group loses the products of pivot columns [begin, end)
  eliminate_group,     ///< its own pivots
  store_factor,        ///< of step or group
  store_contribution,  ///< columns [begin, end) below of `front`
  store_outputs        ///< what the pivots of step or group came to
};

/// Up to two queues compute: steps of the one may hide the chains of pivots at the end of those of the other.
enum class Queue : char { in, out, run, second_run };
inline constexpr std::size_t kQueues = 4;

/// The first `number` operations of a queue of another device.
struct QueueWait {
  Index device = 0;
  Queue queue = Queue::in;
  std::int64_t number = 0;
};

/// One operation. Those of one queue run one after another; before an operation starts, the first waits[q] of queue q
/// of its device must be finished, and so must be the operations of `others`. Only copies wait for other devices, and
/// only for copies.
struct Operation {
  OperationType type = OperationType::eliminate;
  Queue queue = Queue::in;
  bool slab = false;  ///< update: the columns stand as load_slab leaves them, not as in the factor array
  Index unit = 0;     ///< number of the step, or of the group
  bool grouped = false;
  Index front = -1;
  Index begin = 0, end = 0, row = 0;
  std::array<Offset, 2> at{};    ///< device bytes, by part
  std::array<Offset, 2> host{};  ///< elements of the host's store, by part (contributions, factors of groups)
  Offset bytes = 0;              ///< moved
  std::array<std::int64_t, kQueues> waits{};
  std::vector<QueueWait> others;
};

/// Block columns of a contribution that their unit leaves in the arena, and in the store, where nothing else ever
/// comes.
struct LeftContribution {
  Index front = 0;
  std::size_t after = 0;                ///< place in OutOfCorePlan::ops of what has made it
  std::array<Offset, 2> at{-1, -1};     ///< bytes of the arena, by part
  std::array<Offset, 2> store{-1, -1};  ///< elements of the store, by part
  Offset part_bytes = 0;
  bool read_there = false;  ///< the parent's unit reads it in the arena
};

/// By what a plan is chosen: the machine's rates, and what is not to be varied.
struct PlanningRates {
  /// @param pinned  the host's store is to be page-locked
  explicit PlanningRates(const plan::OutOfCoreRates& rates = plan::host_thread().out_of_core, Kind kind = Kind::llt,
                         bool pinned = false);

  double bytes_in, bytes_out;  ///< per second, of each device's link
  double host_bytes;           ///< per second, of all devices and both directions together: the host's memory
  double flops;
  double start;          ///< seconds of an operation besides what it computes ...
  double copy_start;     ///< ... or moves
  double chain;          ///< seconds of a pivot, which waits for the one before it
  double share_seconds;  ///< a front above the sub-trees that takes one device longer is shared
  int lanes = 1;         ///< queues that compute, 1 or 2 (2: a tenth slower on elasticity 64^3 on one H200)
  double step = 0;       ///< bytes of an in-core step, of the budget; 0: whichever seems best
  double group = 0;      ///< bytes of a group of block columns, likewise
  double resident = -1;  ///< bytes of the factors that stay on the device, of the budget; negative: what seems best
  /// Later runs shall make some units again (PartialRun). So all factors go to the store, and so do the contributions
  /// between units, each to a place of its own.
  bool keep_contributions = false;
  // The rates of a solve: bytes of the factor in a second (docs/notebook/out_of_core.md, "Factors that stay").
  double host_solve = 55e9;      ///< read by the host's threads (16 of them: 35 to 60)
  double device_solve = 2.5e12;  ///< by the device, in its own memory
};

/// A device of several.
struct OutOfCoreDevice {
  Offset budget_bytes = 0;
  double speed = 1;  ///< of its arithmetic, relative to the others
};

/// What one device does. Units are numbered for all devices alike; `steps` holds those of this device at their numbers.
struct OutOfCorePlan {
  Offset arena_bytes = 0;  ///< device memory: the peak, exactly
  Offset shared_at = 0;    ///< 256 bytes for what all units share
  std::vector<InCoreStep> steps;
  std::vector<ColumnGroup> groups;
  std::vector<Operation> ops;
  std::vector<LeftContribution> left;  ///< by rising `after`; only of plans that keep contributions
  std::vector<Offset> factor_store;    ///< fronts; elements of the host's store where the first factor array begins
  std::vector<Offset> factor2_store;   ///< fronts; likewise of the second (lu; ldlt: large fronts only)
  /// fronts; bytes of the arena where the factor arrays are after the factorization (the second: lu), -1: in the store,
  /// where the others have no place. With a front, all above it are there.
  std::vector<std::array<Offset, 2>> resident_at;
  std::vector<Index> resident;           ///< these fronts, ascending
  std::vector<Index> streamed;           ///< sub-trees below them that a solve reads from the store through the link
  Offset resident_bytes = 0;             ///< of the factors of `resident`
  Offset solve_at = 0, solve_bytes = 0;  ///< of the arena, free after a factorization: for the solve of both
  Index solve_columns = 0;               ///< right-hand sides for which there is room
  Offset store_elements = 0;             ///< of the host's store: factors, then contributions
  Offset factor_elements = 0;            ///< factors of it
  Offset bytes_in = 0, bytes_out = 0;
  int lanes = 1;  ///< queues that compute
  double predicted_seconds = 0;
  double link_seconds = 0;   ///< what the busier direction of the link needs alone
  double solve_seconds = 0;  ///< predicted, for one right-hand side
};

/// No plan exists for the budgets.
class BudgetTooSmall : public Error {
 public:
  BudgetTooSmall(const std::string& what, Offset needed) : Error(StatusCode::out_of_memory, what), needed_(needed) {}
  /// Bytes of each device with which there is one.
  [[nodiscard]] Offset needed() const { return needed_; }

 private:
  Offset needed_;
};

/// What a factor on disk needs of the host's memory is not there.
class WindowTooSmall : public Error {
 public:
  WindowTooSmall(const std::string& what, Offset missing) : Error(StatusCode::out_of_memory, what), missing_(missing) {}
  [[nodiscard]] Offset missing() const { return missing_; }  ///< bytes

 private:
  Offset missing_;
};

/// The best plans that it finds for the budgets, one for each device; the store's places are the same in all.
/// @param pool  its threads prepare the steps of each candidate; null: the calling thread. The plans do not depend on
/// it
/// @pre layout.plan() is one for a single device
/// @throws BudgetTooSmall
std::vector<OutOfCorePlan> plan_out_of_core(const OutOfCoreLayout& layout, const std::vector<OutOfCoreDevice>& devices,
                                            const PlanningRates& rates = PlanningRates(),
                                            base::ThreadPool* pool = nullptr);

}  // namespace espalier::out_of_core

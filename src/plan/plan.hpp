/// \file
/// The plan: everything about a factorization that the pattern alone decides. Executors (host, CUDA, simulator) carry
/// it out; none of them decides anything of its own, and the plan asks none of them: what a backend wants (widths of
/// tiles, sizes of arrays, the rates of its machine) stands in PlanOptions.
#pragma once

#include <cstdint>
#include <vector>

#include "analysis/assembly_tree.hpp"
#include "base/lazy_vector.hpp"
#include "base/thread_pool.hpp"
#include "espalier/matrix.hpp"
#include "matrix/row_index.hpp"
#include "plan/front_layout.hpp"
#include "plan/ownership.hpp"

namespace espalier::plan {

/// One unit of work. A *tile task* makes tile (i, j) of front `front`, left-looking: it gathers entries of A and the
/// children's contributions, subtracts the products of the finished tiles to its left, then factors it (i == j, pivot
/// column), solves with the diagonal tile (j a pivot column), or leaves it as contribution. A *range task* (`begin` >=
/// 0) eliminates the fronts begin .. front, a set of whole small fronts, one after another on one worker.
struct Task {
  Index front = 0;   ///< the front; the last one of a range
  Index begin = -1;  ///< first front of a range; -1 for a tile task
  Index i = 0;
  Index j = 0;
  [[nodiscard]] bool is_range() const { return begin >= 0; }
};
using TaskList = base::LazyVector<Task>;

/// An entry of the caller's matrix on its way into a tile: values[source] is added at (row, column) of the tile. For
/// lu, an entry of U stands transposed, in the tile of U^T (`transposed`), except in diagonal tiles, which are full
/// squares. Packed into 64 bits: up to 2^40 values, tiles up to 2,047 wide.
class EntryPlace {
 public:
  EntryPlace() = default;
  EntryPlace(Offset source, Index row, Index col, bool transposed)
      : bits_(static_cast<std::uint64_t>(source) << 23 | static_cast<std::uint64_t>(row) << 12 |
              static_cast<std::uint64_t>(col) << 1 | static_cast<std::uint64_t>(transposed)) {}
  [[nodiscard]] Offset source() const { return static_cast<Offset>(bits_ >> 23); }
  [[nodiscard]] Index row() const { return static_cast<Index>(bits_ >> 12 & 2047); }
  [[nodiscard]] Index col() const { return static_cast<Index>(bits_ >> 1 & 2047); }
  [[nodiscard]] bool transposed() const { return (bits_ & 1) != 0; }

 private:
  std::uint64_t bits_;
};

/// How a front is taken: as one task, or in tiles, narrow or wide ones (TileRule).
enum class FrontForm : char { whole, narrow, wide };

/// How a backend's arrays hold a front: an input of the plan. Where none is given, memory is planned for FrontLayout's
/// own arrays.
class ArrayLayout {
 public:
  virtual ~ArrayLayout() = default;
  /// Elements of the array of L, and of the contribution's lower part.
  [[nodiscard]] virtual Offset factor_elements(const FrontLayout& layout, FrontForm form) const = 0;
  [[nodiscard]] virtual Offset contribution_elements(const FrontLayout& layout, FrontForm form) const = 0;
};

/// Sizes of all fronts' arrays, in elements.
struct ArraySizes {
  std::vector<Offset> factor;        ///< fronts; of L alone
  std::vector<Offset> contribution;  ///< fronts; of the lower part alone
  /// Several devices: fronts; the region of memory of its own in which the arrays of a front lie, -1: in none that is
  /// planned. Empty: all in one arena.
  std::vector<Index> region;
  Index regions = 0;       ///< their number
  std::vector<char> late;  ///< with regions: fronts; 1: its tasks follow all others of its region
};

/// What shapes the plan besides the tree.
struct PlanOptions {
  TileRule tiles;
  bool unsymmetric = false;  ///< lu: two factor arrays per front
  bool ldlt = false;         ///< keeps L D of a front beside L while the front is worked on
  double range_flops = 1e6;  ///< sub-trees of whole small fronts with at most that much work become one range task
  Offset group_entries =
      4 << 20;           ///< sub-trees whose contributions all fit here are taken tier by tier, others branch by branch
  Index interleave = 4;  ///< that many fronts of a tier advance together, block column by block column
  Index reuse_distance = 64;  ///< a dead region is reused only by fronts that start so many tasks later
  Index devices = 1;          ///< devices that share the plan, of all ranks together
  /// Ranks (processes that exchange messages) that the devices belong to, in equal parts, one rank after another. The
  /// tree is cut for ranks first, then each rank's part for its devices. make_plan() makes the part of `rank` alone,
  /// and needs one device a rank.
  Index ranks = 1;
  Index rank = 0;
  /// Several devices: sub-trees per device beyond the first, so that what one device lacks another can give. More of
  /// them balance better, but leave more of the tree to the shared top and take more memory. By the cost model, on 2
  /// and 4 devices, the largest load is above the mean by 0, 1, 3: 11, 0.6, 0.6 % of a device's share at worst, and the
  /// top has 26, 44, 61 % of elasticity 24^3 on 4, and 8, 20, 31 % of a plate of 160 x 160.
  double additional_subtrees = 1;
  bool stealing = true;                  ///< a device without unopened sub-trees takes one of another
  MachineModel machine = host_thread();  ///< by which the tree is cut and dealt to devices
  bool balance_unknowns = false;         ///< every unknown costs the same instead: what plain bisection balances
  /// Speeds of the devices, relative to each other; empty: all are equal.
  std::vector<double> device_speed;
  bool balance_columns = false;  ///< block columns of the top are dealt by predicted load, not in turn
  Index column_group = 1;        ///< at most so many; see Ownership
  /// The task list walks every sub-tree alone, so that it can be stolen; else all sub-trees of a device together, so
  /// that more fronts are in work at a time.
  bool subtrees_apart = true;
  /// By which memory is planned; null: by FrontLayout. Must outlive the plan. Several devices then have memories of
  /// their own, each a region or more (plan/regions.hpp).
  const ArrayLayout* arrays = nullptr;
  /// One device: fronts that, with all below them, are narrow (TileRule::narrow_rows) or whole stand first in the task
  /// list.
  bool narrow_first = false;
  bool shared_top = true;  ///< block columns of the top are dealt to all devices; else all are the first one's
  /// In core, on ranks the sub-trees: all that fronts make has places of its own, what they leave for their parents and
  /// L D of ldlt too, so that the next factorization need not make it again where nothing has changed. Out of core it
  /// has places in the store.
  bool keep_contributions = false;
};

/// Places in the arena that holds factors, contributions and work arrays; elements, not bytes. A region
/// is reused once its content is dead; since tasks overlap in time, the front that reuses it first waits for the fronts
/// in `wait_fronts` to be finished (they stand earlier in the task list, so the wait ends). Contributions inside a
/// range task never leave the worker: they live on a stack of its own.
/// With several devices, a sub-tree reuses only places of its own, so that whoever works on it waits for nobody; the
/// top reuses what the sub-trees leave.
struct MemoryPlan {
  Offset size = 0;                    ///< elements of the arena
  Offset added = 0;                   ///< elements of it that changed plans have added (plan/changed_plan.hpp)
  Offset factor_size = 0;             ///< elements of it that hold factors at the end
  Offset stack_size = 0;              ///< elements of each worker's stack for range tasks
  std::vector<Offset> factor;         ///< fronts; start of L (tile by tile)
  std::vector<Offset> factor2;        ///< fronts; start of U^T (lu) or of L D (ldlt, while the front is worked on)
  std::vector<Offset> contribution;   ///< fronts; start of the contribution, lower part (on the stack: see on_stack)
  std::vector<Offset> contribution2;  ///< fronts; start of the transposed upper part (lu)
  std::vector<char> on_stack;         ///< fronts; 1: the contribution is on the worker's stack
  std::vector<Offset> wait_ptr;       ///< fronts + 1
  std::vector<Index> wait_fronts;     ///< fronts to wait for before the first write to this front's arrays
  /// devices; elements that are a device's part of the arena: its sub-trees, its block columns of the top's factors,
  /// and an even part of what the top needs besides. Their sum is `size` at least. Where memory is planned by regions
  /// (ArraySizes::region): regions; the elements of each. Places count from the region's start.
  std::vector<Offset> device_size;
};

/// Where there are several ranks, each has the plan's long arrays for what it knows alone (plan/rank_parts.hpp): rows
/// of fronts, tiles, places of entries, tasks. Of the tree, sizes, layout and owners all ranks know all.
struct Plan {
  analysis::AssemblyTree tree;  ///< several ranks: tree.rows are found by row_begin, not by tree.row_ptr
  PlanOptions options;
  std::vector<FrontLayout> layout;       ///< fronts
  std::vector<char> whole;               ///< fronts; 1: taken whole, by a range task
  std::vector<Offset> child_ptr;         ///< fronts + 1
  std::vector<Index> children;           ///< in the order in which their contributions are added
  base::LazyVector<Index> relative;      ///< like tree.rows: the row's place (0-based row) in the parent's front
  std::vector<Offset> row_begin;         ///< fronts + 1; into tree.rows and `relative`. Empty: tree.row_ptr
  std::vector<Offset> first_tile;        ///< fronts + 1; number of the front's first tile among all tiles
  base::LazyVector<Offset> entry_ptr;    ///< tiles + 1 (whole fronts: all entries at their first tile)
  base::LazyVector<EntryPlace> entries;  ///< sorted by tile, then column, then row
  /// Several ranks: the places in the caller's array of the values that this rank assembles, ascending; EntryPlace's
  /// source is a place in this list. Every value is in the list of one rank. Empty: it is one in the caller's array.
  std::vector<Offset> sources;
  TaskList tasks;                 ///< in topological order
  std::vector<Index> first_task;  ///< fronts; number of the front's first task
  std::vector<Index> last_task;   ///< fronts; number of the front's last task
  std::vector<Index> tier;        ///< fronts; distance from the root
  Ownership ownership;
  MemoryPlan memory;
  Offset nonzeros_factor = 0;  ///< entries of L (L + U for lu), no padding
  double flops = 0;            ///< multiply and add count as two

  [[nodiscard]] Index fronts() const { return tree.fronts(); }
  [[nodiscard]] FrontForm form(Index f) const {
    if (whole[at(f)] != 0) return FrontForm::whole;
    return layout[at(f)].rows <= options.tiles.narrow_rows ? FrontForm::narrow : FrontForm::wide;
  }
  [[nodiscard]] Offset tiles() const { return first_tile.back(); }
  /// Positions of the rows below the pivots of a front, layout[f].below() of them; and their places in its parent.
  [[nodiscard]] const Index* rows_below(Index f) const { return tree.rows.data() + row_at(f); }
  [[nodiscard]] const Index* places_in_parent(Index f) const { return relative.data() + row_at(f); }
  [[nodiscard]] Offset row_at(Index f) const { return (row_begin.empty() ? tree.row_ptr : row_begin)[at(f)]; }
};

struct KeptEntries;

/// Values that factorizations with the plan take. @param entries  of the matrix
inline Offset values_of(const Plan& plan, Offset entries) {
  return plan.row_begin.empty() ? entries : static_cast<Offset>(plan.sources.size());
}

/// Lays out the plan of a matrix with the pattern of `a` (symmetric storage: either triangle or both; duplicates
/// allowed). For lu, row_of_col[c] is the row matched to column c (empty: c itself): the plan is that of the
/// row-permuted matrix.
/// @param rows  index of `a`; null, or of a pattern in both triangles: made here
/// @param kept  what is known of a plan before (plan/kept_entries.hpp); null: nothing
Plan make_plan(analysis::AssemblyTree tree, const MatrixView& a, const std::vector<Index>& row_of_col,
               const PlanOptions& options, base::ThreadPool& pool, const matrix::RowIndex* rows = nullptr,
               const KeptEntries* kept = nullptr);

/// The plan with its tasks listed for one device; no places in memory.
Plan plan_for_one_device(const Plan& plan);

/// Memory for a task list: fills plan.memory from plan.tasks. sizes: null for those of FrontLayout. threads: that may
/// be started where it names regions.
void plan_memory(Plan& plan, const ArraySizes* sizes = nullptr, int threads = 1);

/// Predicted seconds of a front by the plan's machine model, on one worker that has enough else to do.
double front_seconds(const Plan& plan, Index front);

}  // namespace espalier::plan

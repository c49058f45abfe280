/// \file
/// From a plan to the tables of the CUDA backend: its own arena, row blocks instead of tiles, and the order of tasks.
#pragma once

#include <vector>

#include "device/cuda/tables/tables.hpp"
#include "device/cuda/tables/tile_tasks.hpp"
#include "plan/plan.hpp"

namespace espalier::device::cuda {

/// Knobs of the plan that were chosen by measurement (docs/notebook/gpu.md, "Tile width on a GPU").
struct DeviceTuning {
  Index max_block_size = 0;  ///< widest tile column: below 64, all fronts have 32; the kernels know these two widths
  Index narrow_rows = 1024;  ///< fronts of at most that many rows have tile columns of 32, larger ones of 64
  Index whole_rows = 64;     ///< a front of at most that many rows and ...
  Index whole_pivots = 48;   ///< ... at most that many pivots is one task (ldlt: whole_pivots_ldlt)
  /// More than 32 pivots of an indefinite block take two rows a lane, 740 cycles each instead of 440. KKT chains 1000 x
  /// (2,1,1), 200 x (3,2,2), 2 x (20,8,8): 0.367, 0.310, 0.798 ms with 32, 0.414, 0.321, 0.802 with 48.
  Index whole_pivots_ldlt = 32;
  Offset group_entries = Offset{1} << 30;  ///< see PlanOptions
  /// See PlanOptions; 0: 1024 on one device (KKT 3x(40,14,14) in 0.64 GB, 0.74 with 4096), 4096 on each of several,
  /// where 1024 costs a tenth (KKT 20 on two: 2.29 ms instead of 2.08).
  Index reuse_distance = 0;
  double additional_subtrees = 1;    ///< see PlanOptions
  bool stealing = false;             ///< see PlanOptions
  bool shared_top = true;            ///< see PlanOptions
  std::vector<double> device_speed;  ///< see PlanOptions
  bool count_balance = false;        ///< sub-trees are dealt by unknowns instead of predicted time
  Index column_group = 8;            ///< see PlanOptions
  plan::MachineModel machine = plan::h200();
};

/// How a plan for this backend and so many devices is to be made. The executor accepts no other plan.
plan::PlanOptions cuda_plan_options(Kind kind, const DeviceTuning& tuning = {}, Index devices = 1);

/// What one device does. Tasks [0, narrow_tasks) touch only fronts that, with all below them, have narrow tiles; they
/// are run by a kernel with more blocks on each multiprocessor. With several devices, the lists are parts of one list
/// in topological order, so that the lowest unfinished task can always proceed.
struct TaskLists {
  base::LazyVector<FactorTask> tasks;
  std::int64_t narrow_tasks = 0;
  std::vector<SolveTask> up;        ///< forward substitution
  std::vector<SolveTask> down;      ///< backward substitution
  std::vector<SolveTask> inverses;  ///< blocks of pivots whose inverses are joined for the solve (block_inverse.hpp)
  std::int64_t small_up = 0;        ///< the first tasks of `up` belong to sub-trees of small fronts, ...
  std::int64_t small_down = 0;      ///< ... the last ones of `down` likewise
  /// Stealable sub-trees; place after the last task. Every device lists all of them: its own, then the others'.
  std::vector<std::int32_t> stealable_end;
};

/// A tile column of a contribution that lies outside of all regions.
struct Place {
  std::int32_t device = 0;
  std::int64_t offset = 0;  ///< elements from the start of that device's space for places
};

/// The tables: for all devices the same, but for the lists of tasks. With more than kMostDevices devices, which nothing
/// but a simulation can use, Front::members and Front::readers are cut off, and the lists of the solve are not
/// complete.
struct DevicePlan {
  std::vector<Front> fronts;
  std::vector<ChildRows> links;      ///< children, in the order in which their contributions are added
  std::vector<std::int32_t> bounds;  ///< see ChildRows
  std::vector<std::int32_t> waits;   ///< fronts whose memory is reused: they must be finished first
  std::vector<TaskLists> lists;      ///< devices
  std::int64_t flags = 0;
  std::vector<std::int64_t> regions;  ///< elements of each region
  /// One device: elements of its region that hold factors after a factorization; what stands behind is free until the
  /// next one begins.
  std::int64_t kept = 0;
  /// regions; the device where it lies. Of several devices, each has a copy of region 0, the top.
  std::vector<std::int32_t> region_device;
  /// Regions from this one on are stealable sub-trees; region_device tells whose they are unless they are stolen.
  std::int32_t first_stealable = 0;
  std::vector<Place> places;              ///< tile columns of contributions of the top, see Front::place()
  std::vector<std::int64_t> place_space;  ///< devices; elements that these columns take there
};

/// @param pool  null: on the calling thread
/// @param peer_access  false: devices cannot reach each other's memory: sub-trees stay with their devices, and what is
///                     passed on from them has places, too
/// @param mirrored  with peer_access: the same for sub-trees, but each device has its copy of the top and of what it
///                  gathers from others (executor/tile_exchange.hpp)
/// @throws std::invalid_argument when the plan was not made with cuda_plan_options()
DevicePlan make_device_plan(const plan::Plan& plan, Kind kind, bool peer_access = true, const TaskOrder& shape = {},
                            base::ThreadPool* pool = nullptr, bool mirrored = false);

/// Elements that each device stores into others (blocks of the top's factors) and fetches from others (contributions,
/// by even shares of their readers), in one factorization in which nothing is stolen.
std::vector<double> transferred_elements(const plan::Plan& plan, Kind kind, const DevicePlan& tables);

}  // namespace espalier::device::cuda

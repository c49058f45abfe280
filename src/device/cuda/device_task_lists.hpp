/// \file
/// The order in which the kernels of the CUDA backend take their tasks.
#pragma once

#include <vector>

#include "device/cuda/device_plan.hpp"

namespace espalier::device::cuda {

inline constexpr Index kNarrowTiles = 32;  ///< width of the tile columns of small fronts
inline constexpr Index kWideTiles = 64;    ///< of all others

/// Fills d.lists and Front::tasks.
/// @param order   the plan's tasks, those of narrow fronts first
/// @param narrow  fronts; 1: the front and all below it have narrow tiles
/// @param shape   what may run side by side
/// @param d       all else is there
void list_tasks(const analysis::Plan& plan, Kind kind, const std::vector<analysis::Task>& order,
                const std::vector<char>& narrow, const TaskOrder& shape, base::ThreadPool& pool, DevicePlan& d);

}  // namespace espalier::device::cuda

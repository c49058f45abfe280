/// \file
/// The order in which the kernels of the CUDA backend take their tasks.
#pragma once

#include <vector>

#include "device/cuda/tables/device_plan.hpp"

namespace espalier::device::cuda {

/// Fills d.lists and Front::tasks.
/// @param narrow  fronts; 1: the front and all below it have narrow tiles, so that its tasks come first
/// @param order   what may run side by side
/// @param d       all else is there
void list_tasks(const plan::Plan& plan, Kind kind, const std::vector<char>& narrow, const TaskOrder& order,
                base::ThreadPool& pool, DevicePlan& d);

}  // namespace espalier::device::cuda

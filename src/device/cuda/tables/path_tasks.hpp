/// \file
/// The tasks of a solve that passes some fronts alone.
#pragma once

#include <cstdint>
#include <vector>

#include "device/cuda/tables/device_plan.hpp"
#include "device/executor.hpp"

namespace espalier::device::cuda {

/// As in TaskLists, of the fronts on the paths.
struct PathTasks {
  std::vector<SolveTask> up, down;
  std::int64_t small_up = 0, small_down = 0;
  std::vector<unsigned char> marks;  ///< fronts; PathMark
  std::vector<std::int32_t> fronts;  ///< that have a mark
};
PathTasks tasks_on_paths(const TaskLists& all, const FrontPaths& paths);

}  // namespace espalier::device::cuda

#include "device/cuda/tables/path_tasks.hpp"

namespace espalier::device::cuda {

PathTasks tasks_on_paths(const TaskLists& all, const FrontPaths& paths) {
  PathTasks some;
  some.marks.resize(paths.up.size());
  for (std::size_t f = 0; f < paths.up.size(); ++f) {
    some.marks[f] = static_cast<unsigned char>((paths.up[f] != 0 ? kPathUp : 0) | (paths.down[f] != 0 ? kPathDown : 0));
    if (some.marks[f] != 0) some.fronts.push_back(static_cast<std::int32_t>(f));
  }
  const auto mark = [&](const SolveTask& task) { return some.marks[at(task.front)]; };
  for (std::size_t k = 0; k < all.up.size(); ++k) {
    if ((mark(all.up[k]) & kPathUp) == 0) continue;
    some.up.push_back(all.up[k]);
    some.small_up += static_cast<std::int64_t>(k) < all.small_up ? 1 : 0;
  }
  const auto small = static_cast<std::int64_t>(all.down.size()) - all.small_down;
  for (std::size_t k = 0; k < all.down.size(); ++k) {
    SolveTask task = all.down[k];
    if ((mark(task) & kPathDown) == 0) continue;
    if ((mark(task) & kPathUp) == 0) task.block = -1 - task.block;
    some.down.push_back(task);
    some.small_down += static_cast<std::int64_t>(k) >= small ? 1 : 0;
  }
  return some;
}

}  // namespace espalier::device::cuda

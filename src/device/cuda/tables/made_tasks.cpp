#include "device/cuda/tables/made_tasks.hpp"

#include <algorithm>
#include <iterator>

#include "base/at.hpp"

namespace espalier::device::cuda {

MadeTasks tasks_of(const TaskLists& all, std::span<const char> made) {
  MadeTasks some;
  const auto is_made = [made](const auto& task) { return made[at(task.front)] != 0; };
  const auto narrow_end = all.tasks.begin() + static_cast<std::ptrdiff_t>(all.narrow_tasks);
  std::copy_if(all.tasks.begin(), narrow_end, std::back_inserter(some.tasks), is_made);
  some.narrow_tasks = static_cast<std::int64_t>(some.tasks.size());
  std::copy_if(narrow_end, all.tasks.end(), std::back_inserter(some.tasks), is_made);
  std::copy_if(all.inverses.begin(), all.inverses.end(), std::back_inserter(some.inverses), is_made);
  return some;
}

}  // namespace espalier::device::cuda

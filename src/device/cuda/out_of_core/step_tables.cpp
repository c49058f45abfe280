// Tables of in-core steps.
#include <algorithm>

#include "device/cuda/out_of_core/unit_arrays.hpp"

namespace espalier::device::cuda {

// The front of place k in the step, with its places, links and entries.
void OutOfCoreTables::add_front(const out_of_core::InCoreStep& step, Index k, UnitArrays& arrays,
                                Position& next) const {
  const Index f = step.fronts[static_cast<std::size_t>(k)];
  const Offset work = step.work_at / element_;
  const auto& root = step.root_at[static_cast<std::size_t>(k)];
  Front x = in_arena(device_.fronts[f]);
  x.factor = work + step.memory.factor[k];
  if (!step.memory.factor2.empty()) x.second = work + step.memory.factor2[k];
  x.contribution = root[0] >= 0 ? root[0] / element_ : work + step.memory.contribution[k];
  if (kind_ == Kind::lu) x.contribution_up = root[0] >= 0 ? root[1] / element_ : work + step.memory.contribution2[k];
  x.position = next.pivot;
  next.pivot += x.pivots;
  x.flag0 = next.flag;
  next.flag += x.flags();
  arrays.add_relative(plan_, f, x);
  x.tile0 = static_cast<std::int64_t>(arrays.entry_ptr.size());
  const Offset tile = plan_.first_tile[f];
  arrays.add_entries(plan_, tile, pivot_tile_count(f), plan_.entry_ptr[tile], plan_.entry_ptr[plan_.first_tile[f + 1]]);
  const int link_begin = static_cast<int>(arrays.links.size());
  for (int l = x.link_begin; l < x.link_end; ++l)
    arrays.add_link(device_, device_.links[l], place_in(step, device_.links[l].child), x.tiles);
  x.link_begin = link_begin;
  x.link_end = static_cast<int>(arrays.links.size());
  x.wait_begin = static_cast<int>(step.memory.wait_ptr[k]);
  x.wait_end = static_cast<int>(step.memory.wait_ptr[k + 1]);
  arrays.fronts.push_back(x);
}

// The number of a front in the step's tables: its own fronts, then those that were eliminated before.
std::int32_t OutOfCoreTables::place_in(const out_of_core::InCoreStep& step, Index f) {
  const bool own = std::binary_search(step.fronts.begin(), step.fronts.end(), f);
  const auto& list = own ? step.fronts : step.externals;
  const auto at = std::lower_bound(list.begin(), list.end(), f) - list.begin();
  return static_cast<std::int32_t>(own ? at : at + static_cast<std::ptrdiff_t>(step.fronts.size()));
}

UnitTables OutOfCoreTables::build(const out_of_core::InCoreStep& step) const {
  UnitTables u;
  const Counts c = count(step);
  u.at = places(c);
  u.scratch = scratch_places(c);
  UnitArrays arrays;
  arrays.entries.reserve(static_cast<std::size_t>(c.entries));
  Position next;
  for (Index k = 0; k < static_cast<Index>(step.fronts.size()); ++k) add_front(step, k, arrays, next);
  for (std::size_t k = 0; k < step.externals.size(); ++k) {
    Front x = in_arena(device_.fronts[step.externals[k]]);
    x.contribution = step.external_at[k][0] / element_;
    x.contribution_up = step.external_at[k][1] / element_;
    x.flag0 = next.flag;
    next.flag += x.flags();
    arrays.add_relative(plan_, step.externals[k], x);
    arrays.fronts.push_back(x);
  }
  arrays.waits.assign(step.memory.wait_fronts.begin(), step.memory.wait_fronts.end());
  for (const plan::Task& t : step.tasks) {
    const std::int32_t id = place_in(step, t.front);
    if (t.is_range())
      arrays.add_task(id, Work::whole);
    else if (t.i == t.j)
      arrays.add_column(ahead_, arrays.fronts[static_cast<std::size_t>(id)], id, t.j);
    if (wide_[t.front] == 0) u.narrow_end = static_cast<int>(arrays.tasks.size());
  }
  u.end = u.group_end = static_cast<int>(arrays.tasks.size());
  arrays.write(u);
  return u;
}

}  // namespace espalier::device::cuda

#include "device/cuda/out_of_core/unit_arrays.hpp"

#include <cstring>

namespace espalier::device::cuda {

namespace {

template <class U>
void write_list(UnitTables& u, Offset at, const std::vector<U>& list) {
  if (!list.empty()) std::memcpy(u.bytes.data() + at, list.data(), list.size() * sizeof(U));
}

}  // namespace

Front in_arena(Front x) {
  x.region = 0;
  x.first_place = -1;
  return x;
}

void UnitArrays::add_task(std::int32_t front, Work work, int part, Index block, Index column) {
  FactorTask t;
  t.front = front;
  t.work = work;
  t.part = static_cast<decltype(t.part)>(part);
  t.block = static_cast<decltype(t.block)>(block);
  t.column = static_cast<decltype(t.column)>(column);
  tasks.push_back(t);
}

void UnitArrays::add_column(const TileTasks& tile_tasks, const Front& x, std::int32_t front, Index j) {
  tile_tasks.column(
      x, j, [&](Work work, int part, Index block, Index column) { add_task(front, work, part, block, column); });
}

void UnitArrays::add_relative(const plan::Plan& plan, Index f, Front& x) {
  x.rows = static_cast<std::int64_t>(relative.size());
  const auto* from = plan.relative.data() + plan.tree.row_ptr[f];
  relative.insert(relative.end(), from, from + x.below);
}

void UnitArrays::add_link(const DevicePlan& plan, const ChildRows& from, std::int32_t child, int tiles) {
  links.push_back({child, 0, static_cast<std::int64_t>(bounds.size())});
  const auto begin = plan.bounds.begin() + from.bound;
  bounds.insert(bounds.end(), begin, begin + tiles + 1);
}

void UnitArrays::add_entries(const plan::Plan& plan, Offset tile, Offset tiles, Offset first, Offset end) {
  const auto so_far = static_cast<std::int64_t>(entries.size());
  for (Offset t = tile; t <= tile + tiles; ++t) entry_ptr.push_back(so_far + plan.entry_ptr[t] - first);
  for (Offset e = first; e < end; ++e) {
    const plan::EntryPlace& from = plan.entries[static_cast<std::size_t>(e)];
    entries.emplace_back(so_far + e - first, from.row(), from.col(), from.transposed());
  }
}

void UnitArrays::write(UnitTables& u) const {
  u.bytes.resize(static_cast<std::size_t>(u.at.bytes));
  write_list(u, u.at.fronts, fronts);
  write_list(u, u.at.tasks, tasks);
  write_list(u, u.at.links, links);
  write_list(u, u.at.bounds, bounds);
  write_list(u, u.at.waits, waits);
  write_list(u, u.at.relative, relative);
  write_list(u, u.at.entry_ptr, entry_ptr);
  write_list(u, u.at.entries, entries);
}

}  // namespace espalier::device::cuda

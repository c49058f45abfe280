#include "device/cuda/tables/device_bytes.hpp"

#include "device/cuda/tables/front_shape.hpp"

namespace espalier::device::cuda {

namespace {

template <class... Arrays>
Offset size_of(const Arrays&... arrays) {
  return (Offset{0} + ... + static_cast<Offset>(arrays.size() * sizeof(arrays[0])));
}

}  // namespace

DeviceBytes bytes_of(const plan::Plan& plan, Kind kind, const DevicePlan& t, int self, Offset values, Offset scalar,
                     Offset spare) {
  DeviceBytes b;
  const auto d = at(self);
  Offset arena = t.regions[0];
  for (std::size_t r = 1; r < t.regions.size(); ++r)
    if (t.region_device[r] == self) arena += t.regions[r];
  if (!t.place_space.empty()) arena += t.place_space[d];
  const Offset parts = kind == Kind::lu ? 2 : 1, n = plan.tree.n;
  for (Index f = 0; f < plan.fronts(); ++f) {
    const Front& x = t.fronts[f];
    if ((x.members >> d & 1) == 0) continue;
    const Offset pivots = x.pivots;
    b.factor += parts * rounded(x.factor_size());
    b.factor_entries += parts * (pivots * x.below + pivots * (pivots + 1) / 2);
  }
  b.contributions = (arena - b.factor) * scalar;
  b.factor *= scalar;
  b.factor_entries *= scalar;
  b.values = values * scalar;
  b.spare = spare * scalar;
  const TaskLists& l = t.lists[d];
  b.entries = size_of(plan.entry_ptr, plan.entries);
  b.rows = size_of(plan.relative, plan.tree.rows);
  b.fronts = size_of(t.fronts, t.links, t.bounds, t.waits, t.places);
  b.tasks = size_of(l.tasks, l.up, l.down, l.inverses, l.stealable_end);
  if (plan.options.keep_contributions) b.tasks += size_of(l.tasks, l.inverses) + plan.fronts();  // of some fronts alone
  b.flags = (parts * t.flags + plan.fronts()) * 4 + 2 * n;
  const Offset pivot_vectors = kind == Kind::ldlt ? 3 : 1;
  const Offset solve = 2 * n + static_cast<Offset>(plan.relative.size());
  const bool in_arena = t.lists.size() == 1 && solve <= arena - t.kept;
  b.vectors = (pivot_vectors * n + (in_arena ? 0 : solve)) * scalar;
  return b;
}

}  // namespace espalier::device::cuda

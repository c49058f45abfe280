#include "device/cuda/out_of_core/part_tables.hpp"

#include <algorithm>
#include <iterator>

#include "device/cuda/out_of_core/unit_arrays.hpp"

namespace espalier::device::cuda {

namespace {

constexpr Offset kAligned = 256;

// How much of everything a part has.
struct Counts {
  Offset fronts = 0, up = 0, down = 0, links = 0, bounds = 0, rows = 0, updates = 0, pivots = 0;
};

PartPlaces places_of(const Counts& c, Kind kind, Offset element, Index columns) {
  PartPlaces p;
  Offset at = 0;
  const auto reserve = [&](Offset& place, Offset count, Offset size) {
    place = at;
    at += (count * size + kAligned - 1) / kAligned * kAligned;
  };
  reserve(p.fronts, c.fronts, sizeof(Front));
  reserve(p.up, c.up, sizeof(SolveTask));
  reserve(p.down, c.down, sizeof(SolveTask));
  reserve(p.links, c.links, sizeof(ChildRows));
  reserve(p.bounds, c.bounds, 4);
  reserve(p.relative, c.updates, 4);
  reserve(p.rows, c.rows, 4);
  reserve(p.base, 2, sizeof(void*));
  const Offset diagonal = kind == Kind::ldlt ? c.pivots : 0;
  reserve(p.inverse_d, diagonal, element);
  reserve(p.inverse_e, diagonal, element);
  p.vectors = at;
  reserve(p.rhs, c.pivots * columns, element);
  reserve(p.forward, c.pivots * columns, element);
  reserve(p.solution, c.pivots * columns, element);
  reserve(p.updates, c.updates * columns, element);
  reserve(p.control, 1, PartPlaces::kControlBytes);
  p.bytes = at;
  return p;
}

std::vector<Index> joined(const std::vector<Index>& x, const std::vector<Index>& y) {
  std::vector<Index> list;
  std::merge(x.begin(), x.end(), y.begin(), y.end(), std::back_inserter(list));
  return list;
}

// Puts the tasks of fronts with numbers in the part into its lists, in the order in which the plan has them.
class TaskFilter {
 public:
  TaskFilter(const TaskLists& from, const std::vector<std::int32_t>& number, PartTables& to)
      : from_(from), number_(number), to_(to) {}

  template <class Belongs>
  PartTables::Tasks take(Belongs&& belongs) {
    PartTables::Tasks t;
    t.up = static_cast<int>(to_.up.size());
    for (std::size_t k = 0; k < from_.up.size(); ++k)
      if (belongs(from_.up[k].front)) {
        to_.up.push_back({number_[from_.up[k].front], from_.up[k].block});
        t.small_up += static_cast<std::int64_t>(k) < from_.small_up ? 1 : 0;
      }
    t.ups = static_cast<int>(to_.up.size()) - t.up;
    t.down = static_cast<int>(to_.down.size());
    const auto small = static_cast<std::int64_t>(from_.down.size()) - from_.small_down;
    for (std::size_t k = 0; k < from_.down.size(); ++k)
      if (belongs(from_.down[k].front)) {
        to_.down.push_back({number_[from_.down[k].front], from_.down[k].block});
        t.small_down += static_cast<std::int64_t>(k) >= small ? 1 : 0;
      }
    t.downs = static_cast<int>(to_.down.size()) - t.down;
    return t;
  }

 private:
  const TaskLists& from_;
  const std::vector<std::int32_t>& number_;
  PartTables& to_;
};

}  // namespace

PartTables::PartTables(const plan::Plan& plan, const OutOfCoreTables& tables, const out_of_core::OutOfCorePlan& places,
                       bool with_streamed)
    : part(with_streamed ? joined(places.resident, places.streamed) : places.resident) {
  const DevicePlan& all = tables.device_plan();
  const auto n = static_cast<std::size_t>(plan.fronts());
  std::vector<std::int32_t> number(n, -1);
  for (std::size_t k = 0; k < part.size(); ++k) number[part[k]] = static_cast<std::int32_t>(k);
  for (const Index f : part)
    for (Offset c = plan.child_ptr[f]; c < plan.child_ptr[f + 1]; ++c)
      if (const Index child = plan.children[c]; number[child] < 0 && plan.tree.rows_below(child) > 0)
        children.push_back(child);
  std::sort(children.begin(), children.end());
  for (std::size_t k = 0; k < children.size(); ++k) number[children[k]] = static_cast<std::int32_t>(part.size() + k);

  // Arrays of numbers as those of the units.
  UnitArrays arrays;
  std::vector<Index> position(static_cast<std::size_t>(plan.tree.n), -1);
  const Offset element = tables.element_bytes();
  for (const Index f : part) {
    Front x = in_arena(all.fronts[f]);
    const auto& at = places.resident_at[static_cast<std::size_t>(f)];
    const bool stays = at[0] >= 0;
    x.region = stays ? 0 : 1;
    x.factor = stays ? at[0] / element : places.factor_store[f];
    x.second = stays ? at[1] / element : places.factor2_store[f];
    x.inverted = x.width;  // nobody joins inverses out of core
    for (Index k = 0; k < x.pivots; ++k) position[x.position + k] = pivots + k;
    x.position = pivots;
    pivots += x.pivots;
    const int link_begin = static_cast<int>(arrays.links.size());
    for (int l = x.link_begin; l < x.link_end; ++l)
      arrays.add_link(all, all.links[l], number[all.links[l].child], x.tiles);
    x.link_begin = link_begin;
    x.link_end = static_cast<int>(arrays.links.size());
    arrays.add_relative(plan, f, x);
    fronts.push_back(x);
  }
  rows.reserve(arrays.relative.size());
  for (const Index f : part)
    for (Offset r = plan.tree.row_ptr[f]; r < plan.tree.row_ptr[f + 1]; ++r)
      rows.push_back(position[plan.tree.rows[r]]);
  child_updates = static_cast<Offset>(arrays.relative.size());
  for (const Index f : children) {
    Front x = in_arena(all.fronts[f]);
    arrays.add_relative(plan, f, x);
    fronts.push_back(x);
  }
  links = std::move(arrays.links);
  bounds = std::move(arrays.bounds);
  relative = std::move(arrays.relative);
  updates = static_cast<Offset>(relative.size());

  TaskFilter filter(all.lists.front(), number, *this);
  const auto own = static_cast<std::int32_t>(part.size());
  const auto stays = [&](Index f) { return places.resident_at[static_cast<std::size_t>(f)][0] >= 0; };
  resident = filter.take([&](Index f) { return stays(f); });
  streamed = filter.take([&](Index f) { return !stays(f) && number[f] >= 0 && number[f] < own; });
}

PartPlaces PartTables::places(Kind kind, Offset element_bytes, Index columns) const {
  const auto size = [](const auto& list) { return static_cast<Offset>(list.size()); };
  return places_of({size(fronts), size(up), size(down), size(links), size(bounds), size(rows), updates, pivots}, kind,
                   element_bytes, columns);
}

Offset PartTables::most_bytes(const plan::Plan& plan, const OutOfCoreTables& tables, const std::vector<Index>& part,
                              Offset element_bytes, Index columns) {
  const DevicePlan& all = tables.device_plan();
  Counts c;
  for (const Index f : part) {
    const Front& x = all.fronts[f];
    ++c.fronts;
    c.up += x.blocks;
    c.down += x.pivot_blocks;
    c.links += x.link_end - x.link_begin;
    c.bounds += static_cast<Offset>(x.link_end - x.link_begin) * (x.tiles + 1);
    c.rows += x.below;
    c.pivots += x.pivots;
    // Every child may be outside.
    for (Offset k = plan.child_ptr[f]; k < plan.child_ptr[f + 1]; ++k) {
      const Index child = plan.children[k];
      ++c.fronts;
      if (!std::binary_search(part.begin(), part.end(), child)) c.updates += all.fronts[child].below;
    }
  }
  c.updates += c.rows;
  return places_of(c, Kind::ldlt, element_bytes, columns).bytes;
}

}  // namespace espalier::device::cuda

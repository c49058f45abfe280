#include "device/host/workspace.hpp"

#include <algorithm>

#include "device/host/host_executor.hpp"
#include "device/host/solve_schedule.hpp"

namespace espalier::device::host {

template <class T>
Extent largest_tile(const plan::Plan& plan) {
  Extent e;
  for (Index f = 0; f < plan.fronts(); ++f) {
    const auto& l = plan.layout[f];
    if (plan.whole[f] != 0) {
      e.widest = std::max<Offset>(e.widest, l.pivots);
      // A panel of columns and one of rows more: parts of a front are packed from rows and columns that begin no panel.
      e.area = std::max(e.area, padded<T>(l.rows) * (padded<T>(l.rows) + kPanel<T>)+kPanel<T>);
      continue;
    }
    Offset most = 0;
    for (Index i = 0; i < l.tiles; ++i) most = std::max<Offset>(most, l.width(i));
    e.widest = std::max(e.widest, most);
    e.area = std::max(e.area, padded<T>(most) * padded<T>(most));
  }
  return e;
}

template <class T>
Workspace<T>::Workspace(const plan::Plan& plan, Kind kind, base::MemoryBudget* budget) {
  const auto [area, widest] = largest_tile<T>(plan);
  c = base::Buffer<T>(area, budget);
  if (kind != Kind::llt) c2 = base::Buffer<T>(area, budget);
  panels = base::Buffer<T>(area, budget);
  stack = base::Buffer<T>(plan.memory.stack_size, budget);
  column = base::Buffer<T>(2 * padded<T>(widest) + kPanel<T>, budget);
  marks = base::Buffer<char>(padded<T>(widest), budget);
  runs.reserve(at(3 * 2048));
}

namespace {

// Bytes of a Workspace. @param stack  elements of its stack
template <class T>
Offset workspace_bytes(const Extent& largest, Kind kind, Offset stack) {
  const auto [area, widest] = largest;
  const Offset elements = (kind == Kind::llt ? 2 : 3) * area + stack + 2 * padded<T>(widest) + kPanel<T>;
  return elements * static_cast<Offset>(sizeof(T)) + padded<T>(widest);
}

}  // namespace

int team_begin(Index device, Index devices, int threads) {
  return static_cast<int>((Offset{device} * threads + devices - 1) / devices);
}

template <class T>
std::vector<Offset> device_bytes(const plan::Plan& plan, Kind kind, int threads) {
  const Index devices = plan.ownership.devices;
  const Offset of_worker = workspace_bytes<T>(largest_tile<T>(plan), kind, plan.memory.stack_size);
  std::vector<Offset> bytes;
  for (Index d = 0; d < devices; ++d)
    bytes.push_back(plan.memory.device_size[at(d)] * static_cast<Offset>(sizeof(T)) +
                    (team_begin(d + 1, devices, threads) - team_begin(d, devices, threads)) * of_worker);
  return bytes;
}

template <class T>
Offset host_bytes(const plan::Plan& plan, Kind kind, int threads) {
  return host_bytes<T>(plan, kind, threads, plan.memory.size, plan.memory.stack_size);
}

template <class T>
Offset host_bytes(const plan::Plan& plan, Kind kind, int threads, Offset arena, Offset workers_stack) {
  const auto rows = static_cast<Offset>(plan.tree.rows.size());
  Offset front = 0, tile = 0, stack = 0;                                             // of the solution, rows
  std::vector<Offset> entries(plan.layout.size(), 0), below(plan.layout.size(), 0);  // of the sub-tree
  for (std::size_t f = 0; f < plan.layout.size(); ++f) {
    const auto& l = plan.layout[f];
    front = std::max<Offset>(front, l.padded_begin(l.tiles));
    for (Index i = 0; i < l.tiles; ++i) tile = std::max<Offset>(tile, l.padded(l.width(i)));
    entries[f] += l.factor_size();
    below[f] += l.below();
    if (entries[f] <= kSolveTaskEntries) stack = std::max(stack, below[f]);
    if (const Index parent = plan.tree.parent[f]; parent >= 0) {
      entries[at(parent)] += entries[f];
      below[at(parent)] += below[f];
    }
  }
  const Offset own = workspace_bytes<T>(largest_tile<T>(plan), kind, workers_stack) +
                     (front + kPanel<T> + 2 * tile + stack) * static_cast<Offset>(sizeof(T));
  const Offset shared = arena + rows + (kind == Kind::ldlt ? 2 * plan.tree.n : 0);
  const Offset kept = (kind == Kind::llt ? 1 : 5) * Offset{plan.tree.n} + 2 * plan.tiles() +
                      plan.fronts() * static_cast<Offset>(sizeof(FrontOutcome) + 4 * sizeof(Offset));
  return shared * static_cast<Offset>(sizeof(T)) + threads * own + kept;
}

#define ESPALIER_INSTANTIATE(T)                                                \
  template Extent largest_tile<T>(const plan::Plan&);                          \
  template std::vector<Offset> device_bytes<T>(const plan::Plan&, Kind, int);  \
  template Offset host_bytes<T>(const plan::Plan&, Kind, int);                 \
  template Offset host_bytes<T>(const plan::Plan&, Kind, int, Offset, Offset); \
  template struct Workspace<T>;
ESPALIER_FOR_SCALARS(ESPALIER_INSTANTIATE)
#undef ESPALIER_INSTANTIATE

}  // namespace espalier::device::host

#include "device/cuda/tables/device_regions.hpp"

#include <algorithm>
#include <bit>

namespace espalier::device::cuda {

using plan::Plan;

namespace {

Index pad(Index x) { return (x + kChunk - 1) / kChunk * kChunk; }

void find_narrow(const Plan& plan, Regions& r) {
  const auto is_wide = [&](Index f) {
    return plan.whole[f] == 0 && plan.layout[f].rows > plan.options.tiles.narrow_rows;
  };
  r.narrow.assign(static_cast<std::size_t>(plan.fronts()), 1);
  bool any_wide = false;
  for (Index f = 0; f < plan.fronts() && !any_wide; ++f) any_wide = is_wide(f);
  for (Index f = 0; f < plan.fronts(); ++f) {
    // A stealable sub-tree belongs to one kernel, and to the last, by which time it shows who is behind.
    if (is_wide(f) || (any_wide && r.of[f] >= r.first_stealable)) r.narrow[f] = 0;
    const Index p = plan.tree.parent[f];
    if (p >= 0 && r.narrow[f] == 0) r.narrow[p] = 0;
  }
}

}  // namespace

Front shape_of(const Plan& plan, Index f) {
  Front x;
  const auto& layout = plan.layout[f];
  x.pivots = layout.pivots;
  x.below = layout.below();
  x.whole = plan.whole[f];
  x.width = x.whole != 0 ? kRowBlock : layout.rows <= plan.options.tiles.narrow_rows ? kNarrowTiles : kWideTiles;
  x.width_log2 = std::countr_zero(static_cast<std::uint32_t>(x.width));
  x.inverted = x.width;
  x.pivot_pad = pad(x.pivots);
  x.total_pad = x.pivot_pad + pad(x.below);
  x.below_ld = (x.below + 3) / 4 * 4;
  x.pivot_tiles = layout.pivot_tiles;
  x.tiles = layout.tiles;
  x.pivot_blocks = (x.pivot_pad + kRowBlock - 1) / kRowBlock;
  x.blocks = x.pivot_blocks + (pad(x.below) + kRowBlock - 1) / kRowBlock;
  return x;
}

Regions name_regions(const Plan& plan, bool peer_access) {
  const auto& a = plan.assignment;
  Regions r;
  r.device.assign(1, 0);
  if (a.devices > 1)
    for (Index d = 0; d < a.devices; ++d) r.device.push_back(d);
  r.first_stealable = static_cast<std::int32_t>(r.device.size());
  std::vector<Index> of_subtree(a.subtrees.size());
  for (std::size_t s = 0; s < a.subtrees.size(); ++s) {
    of_subtree[s] = 1 + a.subtrees[s].device;
    if (!a.subtrees[s].apart || !peer_access) continue;
    of_subtree[s] = static_cast<Index>(r.device.size());
    r.device.push_back(a.subtrees[s].device);
  }
  r.of.assign(static_cast<std::size_t>(plan.fronts()), 0);
  for (Index f = 0; f < plan.fronts(); ++f)
    if (const Index s = a.subtree(f); s >= 0) r.of[f] = of_subtree[static_cast<std::size_t>(s)];
  find_narrow(plan, r);
  return r;
}

plan::ArraySizes sizes_in_regions(const Plan& plan, const Regions& regions) {
  const auto n = static_cast<std::size_t>(plan.fronts());
  plan::ArraySizes sizes;
  sizes.factor.reserve(n);
  sizes.contribution.reserve(n);
  for (Index f = 0; f < plan.fronts(); ++f) {
    const Front x = shape_of(plan, f);
    sizes.factor.push_back(rounded(x.factor_size()));
    sizes.contribution.push_back(rounded(x.contribution_size()));
  }
  if (plan.assignment.devices == 1) return sizes;
  sizes.regions = static_cast<Index>(regions.device.size());
  sizes.region.resize(n);
  sizes.late.resize(n);
  for (std::size_t f = 0; f < n; ++f) {
    sizes.region[f] = regions.of[f] > 0 ? regions.of[f] : -1;
    sizes.late[f] = static_cast<char>(regions.narrow[f] == 0);
  }
  return sizes;
}

plan::ArraySizes sizes_on_device(const Plan& plan) { return sizes_in_regions(plan, name_regions(plan, true)); }

}  // namespace espalier::device::cuda

#include "plan/regions.hpp"

#include <algorithm>

namespace espalier::plan {

namespace {

// Marks what lies above a marked front.
void mark_above(const Plan& plan, std::vector<char>& marked) {
  for (Index f = 0; f < plan.fronts(); ++f)
    if (const Index p = plan.tree.parent[f]; p >= 0 && marked[f] != 0) marked[p] = 1;
}

// A stealable sub-tree belongs to one kernel, and to the last, by which time it shows who is behind.
void find_narrow(const Plan& plan, Regions& r) {
  std::vector<char> wide = wide_fronts(plan);
  if (std::find(wide.begin(), wide.end(), 1) != wide.end()) {
    for (Index f = 0; f < plan.fronts(); ++f)
      if (r.of[f] >= r.first_stealable) wide[f] = 1;
    mark_above(plan, wide);
  }
  r.narrow.resize(wide.size());
  std::transform(wide.begin(), wide.end(), r.narrow.begin(), [](char w) { return static_cast<char>(w == 0); });
}

}  // namespace

std::vector<char> wide_fronts(const Plan& plan) {
  std::vector<char> wide(at(plan.fronts()));
  for (Index f = 0; f < plan.fronts(); ++f) wide[f] = static_cast<char>(plan.form(f) == FrontForm::wide);
  mark_above(plan, wide);
  return wide;
}

Regions name_regions(const Plan& plan, bool peer_access) {
  const auto& a = plan.ownership;
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
  r.of.assign(at(plan.fronts()), 0);
  for (Index f = 0; f < plan.fronts(); ++f)
    if (const Index s = a.subtree(f); s >= 0) r.of[f] = of_subtree[at(s)];
  find_narrow(plan, r);
  return r;
}

ArraySizes array_sizes(const Plan& plan) {
  const auto n = at(plan.fronts());
  ArraySizes sizes;
  sizes.factor.reserve(n);
  sizes.contribution.reserve(n);
  for (Index f = 0; f < plan.fronts(); ++f) {
    sizes.factor.push_back(plan.options.arrays->factor_elements(plan.layout[f], plan.form(f)));
    sizes.contribution.push_back(plan.options.arrays->contribution_elements(plan.layout[f], plan.form(f)));
  }
  return sizes;
}

ArraySizes array_sizes(const Plan& plan, const Regions& regions) {
  ArraySizes sizes = array_sizes(plan);
  if (plan.ownership.devices == 1) return sizes;
  const auto n = at(plan.fronts());
  sizes.regions = static_cast<Index>(regions.device.size());
  sizes.region.resize(n);
  sizes.late.resize(n);
  for (std::size_t f = 0; f < n; ++f) {
    sizes.region[f] = regions.of[f] > 0 ? regions.of[f] : -1;
    sizes.late[f] = static_cast<char>(regions.narrow[f] == 0);
  }
  return sizes;
}

std::vector<Offset> elements_by_device(const Plan& plan) {
  const Index devices = plan.ownership.devices;
  if (devices == 1) return {plan.memory.size};
  const Regions regions = name_regions(plan, true);
  const ArraySizes sizes = array_sizes(plan);
  Offset top = 0;
  for (Index f = 0; f < plan.fronts(); ++f) {
    if (regions.of[f] > 0) continue;
    const bool two = plan.options.unsymmetric || (plan.options.ldlt && plan.whole[f] == 0);
    top += sizes.factor[f] * (two ? 2 : 1) + sizes.contribution[f] * (plan.options.unsymmetric ? 2 : 1) / devices;
  }
  std::vector<Offset> elements(at(devices), top);
  for (std::size_t r = 1; r < regions.device.size(); ++r) elements[at(regions.device[r])] += plan.memory.device_size[r];
  return elements;
}

}  // namespace espalier::plan

#include "out_of_core/solve_shares.hpp"

#include <algorithm>

namespace espalier::out_of_core {

std::vector<Index> choose_streamed(const OutOfCoreLayout& layout, const std::vector<Index>& resident, double share) {
  const plan::Plan& plan = layout.plan();
  const auto n = at(plan.fronts());
  std::vector<char> is_resident(n, 0);
  for (const Index f : resident) is_resident[f] = 1;
  std::vector<Offset> elements(n, 0);  // of the sub-tree under each front
  std::vector<Index> roots;
  Offset all = 0;
  for (Index f = 0; f < plan.fronts(); ++f) {
    if (is_resident[f] != 0) continue;
    elements[f] += layout.sizes().factor[f];
    all += layout.sizes().factor[f];
    const Index parent = plan.tree.parent[f];
    if (parent >= 0 && is_resident[parent] == 0)
      elements[parent] += elements[f];
    else
      roots.push_back(f);
  }
  // Largest first, while they fit.
  std::stable_sort(roots.begin(), roots.end(), [&](Index x, Index y) { return elements[x] > elements[y]; });
  auto left = static_cast<Offset>(share * static_cast<double>(all));
  std::vector<char> taken(n, 0);
  for (const Index f : roots) {
    // Without a parent it would stand beside what is resident, not below it.
    if (plan.tree.parent[f] < 0 || elements[f] > left) continue;
    left -= elements[f];
    taken[f] = 1;
  }
  std::vector<Index> list;
  for (Index f = plan.fronts() - 1; f >= 0; --f) {
    const Index parent = plan.tree.parent[f];
    if (parent >= 0 && is_resident[f] == 0 && taken[parent] != 0) taken[f] = 1;
    if (taken[f] != 0) list.push_back(f);
  }
  std::reverse(list.begin(), list.end());
  return list;
}

}  // namespace espalier::out_of_core

#include "analysis/device_assignment.hpp"

#include <algorithm>
#include <queue>
#include <utility>

#include "analysis/plan.hpp"

namespace espalier::analysis {

namespace {

// Neighbouring sub-trees are put together as long as their sum stays below this part of the largest that is allowed.
constexpr double kSmallPart = 0.25;

// Predicted seconds and flops of the sub-tree under every front.
struct Costs {
  std::vector<double> seconds, flops;
};

Costs subtree_costs(const Plan& plan) {
  const auto n = static_cast<std::size_t>(plan.fronts());
  Costs c{std::vector<double>(n, 0), std::vector<double>(n, 0)};
  for (Index f = 0; f < plan.fronts(); ++f) {
    const FrontLayout& l = plan.layout[f];
    c.seconds[f] += front_seconds(l.pivots, l.rows, plan.options.unsymmetric, plan.options.cost);
    c.flops[f] += front_flops(l.pivots, l.rows, plan.options.unsymmetric);
    const Index parent = plan.tree.parent[f];
    if (parent < 0) continue;
    c.seconds[parent] += c.seconds[f];
    c.flops[parent] += c.flops[f];
  }
  return c;
}

// Roots of the sub-trees that are left when nothing above `largest` seconds is, ascending. What may become one range
// task is not cut.
std::vector<Index> cut_tree(const Plan& plan, const Costs& costs, double largest) {
  std::priority_queue<std::pair<double, Index>> open;
  for (Index f = 0; f < plan.fronts(); ++f)
    if (plan.tree.parent[f] < 0) open.emplace(costs.seconds[f], f);
  std::vector<Index> roots;
  while (!open.empty()) {
    const auto [seconds, f] = open.top();
    open.pop();
    if (seconds <= largest || costs.flops[f] <= plan.options.range_flops) {
      roots.push_back(f);
      continue;
    }
    for (Offset c = plan.child_ptr[f]; c < plan.child_ptr[f + 1]; ++c)
      open.emplace(costs.seconds[plan.children[c]], plan.children[c]);
  }
  std::sort(roots.begin(), roots.end());
  return roots;
}

std::vector<SubTree> gather(const std::vector<Index>& roots, const Costs& costs, double most) {
  std::vector<SubTree> subtrees;
  for (const Index f : roots) {
    if (subtrees.empty() || subtrees.back().seconds + costs.seconds[f] > most) subtrees.emplace_back();
    subtrees.back().roots.push_back(f);
    subtrees.back().seconds += costs.seconds[f];
  }
  return subtrees;
}

void assign_largest_first(std::vector<SubTree>& subtrees, Index devices) {
  std::stable_sort(subtrees.begin(), subtrees.end(),
                   [](const SubTree& a, const SubTree& b) { return a.seconds > b.seconds; });
  std::vector<double> load(static_cast<std::size_t>(devices), 0);
  for (SubTree& s : subtrees) {
    const auto least = std::min_element(load.begin(), load.end());
    *least += s.seconds;
    s.device = static_cast<Index>(least - load.begin());
  }
  std::stable_sort(subtrees.begin(), subtrees.end(),
                   [](const SubTree& a, const SubTree& b) { return a.device < b.device; });
}

// Who works on a front: its sub-tree's device; in the top, everybody with a sub-tree below.
void find_members(const Plan& plan, DeviceAssignment& a) {
  const std::uint32_t all = a.devices == DeviceAssignment::kMostMembers ? ~0u : (1u << a.devices) - 1;
  a.members.assign(static_cast<std::size_t>(plan.fronts()), 0);
  for (Index f = 0; f < plan.fronts(); ++f) {
    const Index s = a.subtree(f);
    std::uint32_t& mine = a.members[static_cast<std::size_t>(f)];
    if (s >= 0) mine = 1u << a.subtrees[static_cast<std::size_t>(s)].device;
    if (s < 0 && !a.shared_top) mine = 1;
    if (mine == 0) mine = all;  // in the top, and nothing below it
    const Index parent = plan.tree.parent[f];
    if (parent >= 0 && a.subtree(parent) < 0 && a.shared_top) a.members[static_cast<std::size_t>(parent)] |= mine;
  }
}

}  // namespace

DeviceAssignment assign_devices(const Plan& plan) {
  DeviceAssignment a;
  a.devices = std::max<Index>(1, plan.options.devices);
  a.stealing = plan.options.stealing;
  a.shared_top = plan.options.shared_top;
  if (a.devices == 1) return a;
  const Costs costs = subtree_costs(plan);
  double total = 0;
  for (Index f = 0; f < plan.fronts(); ++f)
    if (plan.tree.parent[f] < 0) total += costs.seconds[f];
  const double largest = total / (static_cast<double>(a.devices) * (1 + plan.options.additional_subtrees));
  a.subtrees = gather(cut_tree(plan, costs, largest), costs, kSmallPart * largest);
  assign_largest_first(a.subtrees, a.devices);
  a.subtree_of.assign(static_cast<std::size_t>(plan.fronts()), -1);
  for (std::size_t s = 0; s < a.subtrees.size(); ++s)
    for (const Index f : a.subtrees[s].roots) a.subtree_of[f] = static_cast<Index>(s);
  for (Index f = plan.fronts() - 1; f >= 0; --f) {
    const Index parent = plan.tree.parent[f];
    if (parent >= 0 && a.subtree_of[parent] >= 0) a.subtree_of[f] = a.subtree_of[parent];
  }
  a.column_group = std::max<Index>(1, plan.options.column_group);
  if (a.devices <= DeviceAssignment::kMostMembers) find_members(plan, a);
  return a;
}

}  // namespace espalier::analysis
